'use strict';
/* Pictures that are drawn from numbers alone: colour scale, curve with its law, bars. */

const CURVE_HEIGHT = 126;

const keyOf = (curve) => `${curve.quantity}:${curve.axis}`;
const reachOf = (curve) =>
  Math.max(...finite(f32(curve.mean)).map(Math.abs), ...finite(f32(curve.law)).map(Math.abs), 0);

/** One colour scale for all models, so that the fall is seen: logarithmic, worst cells dark. */
function heatScale(map, layers, unit) {
  const all = layers.map((layer) => quantile(layer, 0.98)).filter(Number.isFinite);
  const lows = layers.map((layer) => quantile(layer, 0.05)).filter(Number.isFinite);
  const high = Math.max(...all) > 0 ? Math.max(...all) : 1;
  const least = map && map.in_sigma ? 1 : Math.min(...lows, high);
  const low = Math.min(high / 2, Math.max(least, high / 60));
  const [factor, letter] = prefix(high * (map ? map.scale : 1), unit);
  const size = factor * (map ? map.scale : 1);
  let stops = [];
  const recolor = () => {
    stops = [0, 1, 2, 3].map((k) => palette[`heat-${k}`].match(/\w\w/g).map((h) => parseInt(h, 16)));
  };
  recolor();
  const color = (value) => {
    const place = 3 * Math.min(1, Math.max(0, Math.log(value / low) / Math.log(high / low || 2)));
    const k = Math.min(2, Math.floor(place));
    const mix = stops[k].map((c, n) => Math.round(c + (stops[k + 1][n] - c) * (place - k)));
    return `rgb(${mix.join(' ')})`;
  };
  const text = (value, bare) => {
    if (map && map.in_sigma && high < 1000) return bare ? times(value) : `${times(value)} sensor noise`;
    return `${digits(value * size)} ${letter}${unitText(unit)}`;
  };
  return {color, text, recolor, low, high};
}

/** Three or so round numbers inside an interval. */
function ticksOf(low, high) {
  const rough = (high - low) / 4;
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = size * [1, 2, 2.5, 5, 10].find((m) => m * size >= rough);
  const ticks = [];
  for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) {
    ticks.push(Number(v.toPrecision(10)));
  }
  return ticks;
}

/** Axis of a curve for people: rotor position in degrees. */
function axisValues(curve) {
  const x = f32(curve.x);
  if (curve.axis !== 'position' || curve.axis_unit !== 'rad') return [x, unitText(curve.axis_unit)];
  return [x.map((v) => (v * 180) / Math.PI), '°'];
}

function curvePicture(curve, width, reach) {
  const [x, xUnit] = axisValues(curve);
  const [mean, band, law] = [curve.mean, curve.band, curve.law].map(f32);
  const [factor, letter] = prefix(reach, curve.unit);
  const frame = chartFrame(width, x, niceReach(reach * factor), xUnit);
  const line = (values, attributes) =>
    svg('path', {d: pathOf(x, values.map((v) => v * factor), frame), ...attributes});
  const area = svg('path', {class: 'band', d: bandOf(x, mean, band, factor, frame)});
  const parts = [svg('text', {x: 0, y: 11, class: 'tick'}, `${letter}${unitText(curve.unit)}`), ...frame.parts, area, line(mean, {class: 'mean'})];
  if (law.length) parts.push(line(law, {class: 'law'}), svg('text', {x: width - 4, y: 11,
    'text-anchor': 'end', class: 'law-name'}, `┄ ${curve.name}`));
  const label = `${cap(curve.quantity)} by ${curve.axis}, up to ` +
    `${digits(reachOf(curve) * factor)} ${letter}${unitText(curve.unit)}${law.length ? `; law: ${curve.name}` : ''}.`;
  return svg('svg', {width, height: CURVE_HEIGHT, role: 'img', 'aria-label': label}, ...parts);
}

const niceReach = (value) => {
  const size = 10 ** Math.floor(Math.log10(value));
  return size * [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find((m) => m * size >= value * 1.02);
};

function chartFrame(width, x, reach, xUnit) {
  const [left, right, top, bottom] = [38, 6, 22, 20];
  const used = finite(x);
  const [x0, x1] = [Math.min(...used), Math.max(...used)];
  const atX = (v) => left + ((v - x0) / (x1 - x0 || 1)) * (width - left - right);
  const atY = (v) => {
    const inside = Math.min(reach, Math.max(-reach, v));
    return top + ((reach - inside) / (2 * reach)) * (CURVE_HEIGHT - top - bottom);
  };
  const tick = (px, py, text, anchor) =>
    svg('text', {x: px, y: py, 'text-anchor': anchor, class: 'tick'}, text);
  const marks = xUnit === '°' ? [0, 90, 180, 270, 360].filter((v) => v >= x0 - 9 && v <= x1 + 9) : ticksOf(x0, x1);
  const clamp = (px) => Math.min(width - right, Math.max(left, px));
  const parts = [
    svg('line', {x1: left, x2: width - right, y1: atY(0), y2: atY(0), class: 'zero'}),
    ...[reach, 0, -reach].map((v) => tick(left - 5, atY(v) + 4, tickText(Number(v.toPrecision(3))), 'end')),
    ...marks.map((v, k) => {
      const last = k === marks.length - 1;
      const px = clamp(atX(v));
      const text = `${tickText(v)}${xUnit === '°' ? '°' : last ? ` ${xUnit}` : ''}`;
      return tick(px, CURVE_HEIGHT - 5, text, px > width - 40 ? 'end' : 'middle');
    }),
  ];
  return {atX, atY, parts};
}

function pathOf(x, y, {atX, atY}) {
  let pen = 'M';
  let d = '';
  for (let k = 0; k < x.length; k += 1) {
    if (Number.isFinite(y[k])) {
      d += `${pen}${atX(x[k]).toFixed(1)} ${atY(y[k]).toFixed(1)}`;
      pen = 'L';
    } else pen = 'M';
  }
  return d;
}

function bandOf(x, mean, band, factor, frame) {
  const good = Array.from(x.keys()).filter((k) => Number.isFinite(mean[k]) && Number.isFinite(band[k]));
  const edge = (order, sign) => order.map((k) =>
    `${frame.atX(x[k]).toFixed(1)} ${frame.atY((mean[k] + sign * band[k]) * factor).toFixed(1)}`);
  return good.length ? `M${[...edge(good, 1), ...edge([...good].reverse(), -1)].join('L')}Z` : '';
}

function wherePicture(where, width) {
  const [left, right, top, bottom] = [38, 6, 22, 20];
  const reach = Math.max(...where.error_percent.filter((v) => v !== null), 1e-12);
  const [x0, x1] = [where.bins[0], where.bins.at(-1)];
  const atX = (v) => left + ((v - x0) / (x1 - x0 || 1)) * (width - left - right);
  const height = CURVE_HEIGHT - top - bottom;
  const tick = (px, py, text, anchor) =>
    svg('text', {x: px, y: py, 'text-anchor': anchor, class: 'tick'}, text);
  const bars = where.error_percent.map((v, k) => v !== null && svg('rect', {class: 'bar',
    x: atX(where.bins[k]) + 0.5, width: Math.max(1, atX(where.bins[k + 1]) - atX(where.bins[k]) - 1),
    y: top + height * (1 - v / reach), height: (height * v) / reach}));
  const marks = ticksOf(x0, x1);
  return svg('svg', {width, height: CURVE_HEIGHT, role: 'img',
    'aria-label': `Error by ${where.axis}, at most ${percent(reach)}.`},
  tick(0, 11, '%', 'start'), ...bars.filter(Boolean), tick(left - 5, top + 4, digits(reach), 'end'), tick(left - 5, top + height, '0', 'end'),
  ...marks.map((v, k) => tick(Math.min(width - 8, atX(v)), CURVE_HEIGHT - 5,
    `${tickText(v)}${k === marks.length - 1 ? ` ${unitText(where.unit)}` : ''}`,
    k === marks.length - 1 ? 'end' : 'middle')));
}
