'use strict';
/* Getting the view, decoding its arrays, making elements, writing numbers. */

/** The one place where the page gets its data: embedded in a report, fetched from a server. */
async function loadView() {
  const embedded = document.getElementById('view');
  return embedded ? JSON.parse(embedded.textContent) : ask('view.json');
}

/** Get something of the server, within so many milliseconds if they are given. */
async function ask(name, patience) {
  const answer = await fetch(name, patience ? {signal: AbortSignal.timeout(patience)} : {});
  if (!answer.ok) throw new Error(`no ${name}: ${answer.status} ${answer.statusText}`);
  return answer.json();
}

/** Ask the server for a change (`add` or `remove` an effect) of a model and return the new view. */
async function act(verb, step, effect) {
  const answer = await fetch(`actions/${verb}`, {
    method: 'POST',
    headers: {'Content-Type': 'application/json'},
    body: JSON.stringify({step, effect}),
  });
  if (!answer.ok) throw new Error((await answer.text()) || answer.statusText);
  return answer.json();
}

const decode = (Type) => (text) => {
  if (!text) return new Type(0);
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Type(bytes.buffer);
};
const f32 = decode(Float32Array);
const f64 = decode(Float64Array);
const u8 = decode(Uint8Array);
const u16 = decode(Uint16Array);
const u32 = decode(Uint32Array);

/** A plain array in which NaN is null: what uPlot takes for a gap. */
const withGaps = (values) => Array.from(values, (v) => (Number.isNaN(v) ? null : v));

const $ = (selector, root = document) => root.querySelector(selector);

function build(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? '' : value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
}
const el = (tag, attributes = {}, ...children) =>
  build(document.createElement(tag), attributes, children);
const svg = (tag, attributes = {}, ...children) =>
  build(document.createElementNS('http://www.w3.org/2000/svg', tag), attributes, children);

/** Colours as the style sheet has them at the moment. */
let palette = {};
function readPalette() {
  const style = getComputedStyle(document.documentElement);
  palette = {};
  for (const name of ['text', 'muted', 'line', 'measured', 'model', 'error', 'ghost', 'noise', 'input',
    'mark', 'train', 'joint', 'ok', 'card', 'heat-0', 'heat-1', 'heat-2', 'heat-3',
    'regime-0', 'regime-1', 'regime-2', 'regime-3']) {
    palette[name] = style.getPropertyValue(`--${name}`).trim();
  }
}

const cap = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const listed = (items) =>
  items.length > 1 ? `${items.slice(0, -1).join(', ')} and ${items.at(-1)}` : items.join('');

/** Units as people write them: N·m·s/rad, kg·m², Ω. */
const UNITS = {ohm: 'Ω', degC: '°C', 1: ''};
const SUPERSCRIPTS = {'-': '⁻', 0: '⁰', 1: '¹', 2: '²', 3: '³', 4: '⁴', 5: '⁵', 6: '⁶', 7: '⁷', 8: '⁸', 9: '⁹'};
const raise = (text) => String(text).replace(/[-0-9]/g, (c) => SUPERSCRIPTS[c]);
function unitText(unit) {
  if (unit in UNITS) return UNITS[unit];
  return unit.replace(/\bohm\b/g, 'Ω').replace(/\^(-?\d+)(?![\d.])/g, (_, n) => raise(n)).replace(/ /g, '·');
}
const bracketed = (unit) => (unitText(unit) ? ` [${unitText(unit)}]` : '');

/** Symbols as in a textbook: omega becomes ω. */
const GREEK = {omega: 'ω', theta: 'θ', tau: 'τ', psi: 'ψ', phi: 'φ', sigma: 'σ'};
const symbols = (text) =>
  text.replace(/(?<![A-Za-z])(omega|theta|tau|psi|phi|sigma)(?![A-Za-z])/g, (word) => GREEK[word]);

const MINUS = '−';
const minus = (text) => text.replace('-', MINUS);

/** A number with so many significant digits, never in e-notation. */
function digits(value, count = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent < -3 || exponent > 4) return scaled(value, exponent, count - 1);
  return minus(value.toFixed(Math.max(0, count - 1 - exponent)));
}
const scaled = (value, exponent, places) =>
  `${minus((value / 10 ** exponent).toFixed(Math.max(0, places)))}·10${raise(exponent)}`;

const percent = (value) => (value === null ? '–' : `${digits(value, value < 0.1 ? 2 : 3)} %`);
/** A factor: 1.3×, 15×, 1600×. */
const times = (value) => (value === null ? '–'
  : `${value < 10 ? value.toFixed(1) : value < 1e4 ? Number(value.toPrecision(2)) : digits(Number(value.toPrecision(2)), 2)}×`);
const share = (value) => (value === null ? '–' : `${Math.round(100 * value)} %`);

/** Value and sigma with one exponent, and as many digits as sigma deserves. */
function withSigma(value, sigma) {
  if (value === null) return ['–', ''];
  if (!sigma) return [Number.isInteger(value) && Math.abs(value) < 1e5 ? minus(String(value)) : digits(value, 4), ''];
  const size = Math.floor(Math.log10(Math.max(Math.abs(value), sigma)));
  const exponent = size < -3 || size > 4 ? size : 0;
  const places = Math.min(7, Math.max(0, exponent - Math.floor(Math.log10(sigma)) + 1));
  const write = (v) => minus((v / 10 ** exponent).toFixed(places));
  const tail = exponent ? `·10${raise(exponent)}` : '';
  return [write(value) + tail, write(sigma) + tail];
}

/** A factor and a prefix that make the largest of some values easy to read: [1000, 'm']. */
function prefix(largest, unit) {
  if (!unit || unit === '1' || unit === 'rad' || unit === '%' || !(largest > 0)) return [1, ''];
  if (/^(kg|ohm|1\/)/.test(unit)) return [1, ''];
  if (largest < 0.5e-3) return [1e6, 'µ'];
  if (largest < 0.5) return [1e3, 'm'];
  if (largest >= 2e4) return [1e-3, 'k'];
  return [1, ''];
}

/** Limits of an axis with a little room around the values. */
function padded(low, high) {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
  const room = 0.07 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - room, high + room];
}

const tickText = (value) => minus(String(Number(value.toPrecision(6))));

const finite = (values) => Array.from(values).filter(Number.isFinite);
function quantile(values, q) {
  const sorted = finite(values).sort((a, b) => a - b);
  return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(q * sorted.length))] : NaN;
}

/** One tooltip for the page. */
const tip = {
  show(text, event) {
    const node = $('#tip');
    node.textContent = text;
    node.hidden = false;
    const left = Math.min(event.clientX + 14, innerWidth - node.offsetWidth - 8);
    const top = Math.min(event.clientY + 14, innerHeight - node.offsetHeight - 8);
    node.style.left = `${Math.max(4, left)}px`;
    node.style.top = `${Math.max(4, top)}px`;
  },
  hide() {
    $('#tip').hidden = true;
  },
};
