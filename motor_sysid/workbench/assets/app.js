'use strict';
/* State of the page and what happens when it changes. */

const page = {view: null, step: 0, ghost: 'previous', traces: null, where: null, candidates: null, timer: null,
  doing: ''};

const ghostOf = (step) =>
  (page.ghost === 'none' ? null : page.ghost === 'previous' ? parentOf(page.view, step)
    : Number(page.ghost) === step ? null : Number(page.ghost));

function pick(step, announce = true) {
  page.step = Math.min(page.view.steps.length - 1, Math.max(0, step));
  keepingFocus(drawModel);
  if (announce && !page.doing) say(page.step);
}

function drawModel() {
  const {view} = page;
  drawNow(view, page.step);
  drawLadder(view, page.step, pickByHand);
  drawStepper(view, page.step, pickByHand);
  page.traces.show({step: page.step, ghost: ghostOf(page.step)});
  page.where.show(page.step);
  page.candidates.show(page.step);
  drawModels(view, page.step, pickByHand, change);
  drawParameters(view, page.step);
  drawGhostKey();
  $('#keep-model').href = `model.yaml?step=${page.step}`;
  reachScrolled();
}

/** Draw, and give the keyboard back the control that it was on, or the model shown where that is gone. */
function keepingFocus(draw) {
  const hold = document.activeElement?.dataset.hold;
  draw();
  if (!hold || document.activeElement !== document.body) return;
  const next = $(`[data-hold="${CSS.escape(hold)}"]`) || $('#model-table .current .link');
  next?.focus({preventScroll: true});
}

/** What scrolls can be reached with the keyboard. */
function reachScrolled() {
  document.querySelectorAll('.scroll').forEach((box) => {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
    else box.removeAttribute('tabindex');
  });
}

function pickByHand(step) {
  stopPlaying();
  pick(step);
  keepAddress();
}

/** The model shown is in the address: it is shown again after a reload. */
function keepAddress() {
  try {
    history.replaceState(null, '', `#${page.view.steps[page.step].name}`);
  } catch {
    /* a page without an address of its own cannot have one with a fragment */
  }
}

function say(step) {
  const s = page.view.steps[step];
  const before = page.view.steps[parentOf(page.view, step)];
  $('#status').textContent = before
    ? `${before.name} → ${s.name}: ${brief(before.validation_error_percent)} → ${brief(s.validation_error_percent)}`
    : `${s.name}: ${brief(s.validation_error_percent)}`;
}

/* --- playing the ladder ------------------------------------------------------------------ */

function stopPlaying() {
  clearInterval(page.timer);
  page.timer = null;
  $('#play').textContent = '▶ Play';
}

function play() {
  if (page.timer) {
    stopPlaying();
    return;
  }
  pick(0);
  $('#play').textContent = '❚❚ Stop';
  page.timer = setInterval(() => {
    pick(page.step + 1);
    if (page.step === page.view.steps.length - 1) stopPlaying();
  }, 1600);
}

/* --- controls ---------------------------------------------------------------------------- */

function fillControls() {
  const {view, traces} = page;
  fillStretches();
  $('#panels').replaceChildren(...view.panels.slice(1).map((p) => el('label', {},
    el('input', {type: 'checkbox', checked: traces.isShown(p.key), onchange: (e) => traces.toggle(p.key, e.target.checked)}), p.title)));
  const outputs = traces.errorOutputs();
  $('#errors').hidden = outputs.length < 2;
  $('#error-of').replaceChildren(...outputs.map((o) =>
    el('option', {value: o, selected: o === traces.kept().errorOf}, o.replace(/_/g, ' '))));
  $('#error-of').onchange = (e) => traces.show({errorOf: e.target.value});
  fillGhosts();
}

/** The stretches that can be looked at: a button each, and a list of the records if some have none. */
function fillStretches() {
  const {view, traces} = page;
  const go = (from, to) => {
    traces.go(from, to);
    keepingFocus(fillStretches);
  };
  const isHome = (from, to) => String([from, to]) === String(traces.kept().home);
  const button = (text, from, to) => el('button', {type: 'button', 'data-hold': `stretch ${text}`,
    'aria-pressed': String(isHome(from, to)), onclick: () => go(from, to)}, text);
  const stretches = stretchesOf(view, traces);
  const parts = view.records.length > 1 ? [['all', ...traces.all()], ...stretches].map((s) => button(...s)) : [];
  if (stretches.length < view.records.length) parts.push(recordList(view, traces, isHome, go));
  $('#stretches').replaceChildren(...parts);
}

function recordList({records}, traces, isHome, go) {
  const options = recordNames(records, traces).map((name, k) =>
    el('option', {value: k, selected: isHome(records[k].start, records[k].end)}, name));
  return el('select', {'aria-label': 'Record', 'data-hold': 'stretch of a record',
    onchange: ({target}) => go(records[target.value].start, records[target.value].end)},
  el('option', {value: '', disabled: true, selected: true}, 'one record'), ...options);
}

/** What records are called, with their times where that does not tell them apart. */
function recordNames(records, traces) {
  const names = records.map(traces.stretchName);
  const when = (r) => ` · ${digits(r.start - r.clock)} to ${digits(r.end - r.clock)} s`;
  return names.map((name, k) => (names.indexOf(name) === names.lastIndexOf(name) ? name : name + when(records[k])));
}

/** What has a button: every record if they are few and have names, else every role. */
function stretchesOf(view, traces) {
  const {records} = view;
  const names = new Set(records.map((r) => r.label));
  if (records.length <= 4 && names.size === records.length) {
    return records.map((r) => [traces.stretchName(r), r.start, r.end]);
  }
  return ['train', 'validate'].map((role) => records.filter((r) => r.role === role))
    .filter((own) => own.length)
    .map((own) => [own[0].role === 'train' ? 'training' : 'held out', own[0].start, own.at(-1).end]);
}

function fillGhosts() {
  const {view} = page;
  const names = view.steps.map((s, k) => el('option', {value: k}, s.name));
  $('#ghost').replaceChildren(el('option', {value: 'previous'}, 'previous model'), ...names, el('option', {value: 'none'}, 'none'));
  $('#ghost').value = page.ghost;
  $('#ghost').onchange = (e) => {
    page.ghost = e.target.value;
    page.traces.show({ghost: ghostOf(page.step)});
    drawGhostKey();
  };
  $('#ghost-key').hidden = view.steps.length < 2;
}

function drawGhostKey() {
  const ghost = ghostOf(page.step);
  $('#ghost-key').classList.toggle('off', ghost === null);
  const {channels, primary} = page.view;
  $('#noise-key').hidden = !(channels.find((c) => c.key === primary)?.sigma > 0);
}

/** Keys of the page: not what is typed, nor arrows that choose a model or scroll a box. */
function onKey(event) {
  const types = event.target.closest('select, textarea, input:not([type="radio"], [type="checkbox"])');
  const moves = event.key.startsWith('Arrow') && event.target.matches('.scroll, [type="radio"]');
  if (types || moves || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === 'n' || event.key === 'N') pickByHand(page.step + 1);
  else if (event.key === 'p' || event.key === 'P') pickByHand(page.step - 1);
  else page.traces.key(event);
}

function setTheme(dark) {
  document.documentElement.dataset.theme = dark ? 'dark' : 'light';
  readPalette();
  if (!page.traces) return;
  page.traces.recolor();
  page.where.redraw();
}

const THEME = 'motor_sysid theme';

/** The theme that was chosen last time (null: as the system has it), or choose one. */
function chosenTheme(...choice) {
  try {
    if (choice.length) localStorage.setItem(THEME, ...choice);
    return localStorage.getItem(THEME) || null;
  } catch {
    return null; /* this page may not keep anything */
  }
}

const isDark = () => document.documentElement.dataset.theme === 'dark';

function listen() {
  const system = matchMedia('(prefers-color-scheme: dark)');
  system.addEventListener('change', (event) => {
    chosenTheme('');
    setTheme(event.matches);
  });
  $('#theme').onclick = () => {
    setTheme(!isDark());
    chosenTheme(document.documentElement.dataset.theme);
  };
  $('#back').onclick = () => pickByHand(page.step - 1);
  $('#forward').onclick = () => pickByHand(page.step + 1);
  $('#play').onclick = play;
  $('#zoom').onclick = (event) => ({in: page.traces.zoomIn, out: page.traces.zoomOut, reset: page.traces.reset,
    left: () => page.traces.pan(-0.2), right: () => page.traces.pan(0.2)}[event.target.dataset.zoom]?.());
  document.addEventListener('keydown', onKey);
  let width = 0;
  new ResizeObserver(() => requestAnimationFrame(() => {
    page.traces.resize();
    if (document.body.clientWidth === width) return;
    width = document.body.clientWidth;
    drawSized();
  })).observe($('#plots'));
  listenToPrinter();
}

/** Draw again what has the width of the page. */
function drawSized() {
  drawLadder(page.view, page.step, pickByHand);
  drawDifferences(page.view);
  drawUnknown(page.view);
  page.where.redraw();
  reachScrolled();
}

/** On paper the page is light, as wide as paper, and has its reasons unfolded. */
function listenToPrinter() {
  let dark = false;
  let folded = [];
  const lay = (paper) => {
    document.body.classList.toggle('paper', paper);
    setTheme(paper ? false : dark);
    page.traces.resize();
    drawSized();
  };
  addEventListener('beforeprint', () => {
    dark = isDark();
    folded = [...document.querySelectorAll('#verdict details:not([open])')];
    folded.forEach((details) => { details.open = true; });
    lay(true);
  });
  addEventListener('afterprint', () => {
    folded.forEach((details) => { details.open = false; });
    lay(false);
  });
}

/* --- actions: only where something answers ----------------------------------------------- */

const EVERY = 700;
/** Milliseconds in which somebody who is there answers; one who computes may take longer. */
const PATIENCE = 2000;
const PATIENCE_AT_WORK = 10000;

async function change(verb, effect) {
  if (page.doing) return;
  page.acting = true;
  busy(`${verb === 'add' ? 'adding' : 'removing'} ${effect.replace(/_/g, ' ')}`);
  try {
    take(await act(verb, page.step, effect), -1);
  } catch (error) {
    busy('');
    $('#status').textContent = error instanceof TypeError ? 'The workbench does not answer.' : error.message;
  }
  page.acting = false;
}

/** Show a new view, all else as the user has it, and one of its models (-1: the last). */
function take(view, step) {
  busy('');
  show(view);
  pick(step < 0 ? view.steps.length + step : step);
  keepAddress();
}

/** Say what is being done; meanwhile nothing else can be asked for. */
function busy(doing) {
  const ended = page.doing && !doing;
  page.doing = doing;
  document.body.classList.toggle('busy', Boolean(doing));
  document.querySelectorAll('button.act').forEach((button) => {
    if (doing) button.setAttribute('aria-disabled', 'true');
    else button.removeAttribute('aria-disabled');
  });
  if (doing) $('#status').textContent = `${cap(doing)} …`;
  else if (ended) say(page.step);
}

/** Follow what other tabs do and how far the work is, and say so if nobody answers. */
async function follow() {
  let state = null;
  let view = null;
  try {
    state = await ask('state.json', page.doing ? PATIENCE_AT_WORK : PATIENCE);
    if (!state.doing && !page.acting && state.version !== page.view.version) view = await loadView();
  } catch {
    state = null;
  }
  setTimeout(follow, EVERY);
  $('#gone').hidden = state !== null;
  if (state?.doing) busy(state.doing);
  else if (state && !page.acting) {
    if (view) take(view, -1);
    else busy('');
  }
}

/** What tells data apart; how many points are drawn of them depends on the number of models. */
const dataOf = (view) =>
  JSON.stringify(view.records.map((r) => [r.source, r.label, r.role, r.start, r.end, r.samples]));

/** Show a view: of the same data as before with all that the user has chosen. */
function show(view) {
  const same = page.view && dataOf(page.view) === dataOf(view);
  const kept = same ? {traces: page.traces.kept(), where: page.where.kept()} : {};
  page.traces?.destroy();
  page.view = view;
  if (Number(page.ghost) >= view.steps.length) page.ghost = 'previous';
  page.traces = makeTraces(view, kept.traces);
  page.where = makeWhere(view, page.traces.mark, kept.where);
  page.candidates = makeCandidates(view, change);
  document.title = `motor_sysid ${view.actions ? 'workbench' : 'report'} · ${view.source}`;
  $('#kind').textContent = view.actions ? 'workbench' : 'report';
  $('#source').textContent = [view.source, view.motor.title, lengthText(view), view.held_out].join(' · ');
  const bucket = Math.max(...view.records.map((r) => r.bucket));
  $('#drawn').textContent = bucket > 1 ? ` · drawn: extremes of up to ${bucket} samples` : '';
  drawHeadline(view);
  drawBlindSpots(view);
  drawDifferences(view);
  drawUnknown(view);
  fillControls();
}

function lengthText(view) {
  const seconds = view.records.reduce((sum, r) => sum + r.end - r.start, 0);
  const rates = [...new Set(view.records.map((r) => digits(r.rate_hz)))];
  return `${digits(seconds)} s at ${rates.join(', ')} Hz`;
}

async function start() {
  const theme = chosenTheme();
  setTheme(theme ? theme === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches);
  try {
    show(await loadView());
  } catch (error) {
    $('#headline').textContent = `This page cannot be shown: ${error.message}`;
    throw error;
  }
  const asked = page.view.steps.findIndex((s) => `#${s.name}` === location.hash);
  pick(asked >= 0 ? asked : page.view.first, false);
  listen();
  $('#keep').hidden = !page.view.actions;
  if (page.view.actions) follow();
  document.body.dataset.ready = 'true';
}

start();
