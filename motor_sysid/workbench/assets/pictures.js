'use strict';
/* Pictures that are drawn from numbers alone: colour scale, curve with its law, bars. */

const CURVE_HEIGHT = 126;
const MAP_HEIGHT = 138;
const WAYS = ['backward', 'rest', 'forward'];

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

/** Whether noise alone makes a curve like this more often than once in twenty times. */
const isNoise = (curve) => curve.chance !== null && curve.chance !== undefined && curve.chance > 0.05;

function curvePicture(curve, width, reach) {
  const [x, xUnit] = axisValues(curve);
  const [mean, band, law] = [curve.mean, curve.band, curve.law].map(f32);
  const [factor, letter] = prefix(reach, curve.unit);
  const frame = chartFrame(width, x, niceReach(reach * factor), xUnit, curve.axis);
  const line = (values, attributes) =>
    svg('path', {d: pathOf(x, values.map((v) => v * factor), frame), ...attributes});
  const area = svg('path', {class: 'band', d: bandOf(x, mean, band, factor, frame)});
  const noisy = isNoise(curve);
  const parts = [svg('text', {x: 0, y: 11, class: 'tick'}, `${letter}${unitText(curve.unit)}`), ...frame.parts, area,
    line(mean, {class: noisy ? 'mean calm' : 'mean'})];
  if (noisy && !law.length) parts.push(svg('text', {x: width - 4, y: 11, 'text-anchor': 'end', class: 'tick'}, 'no more than noise'));
  if (law.length) parts.push(line(law, {class: 'law'}), svg('text', {x: width - 4, y: 11,
    'text-anchor': 'end', class: 'law-name'}, `┄ ${curve.name}`));
  const label = `${cap(curve.quantity)} by ${curve.axis}, up to ` +
    `${digits(reachOf(curve) * factor)} ${letter}${unitText(curve.unit)}${law.length ? `; law: ${curve.name}` : ''}.`;
  return svg('svg', {width, height: CURVE_HEIGHT, role: 'img', 'aria-label': label}, ...parts);
}

const niceReach = (value) => {
  const size = 10 ** Math.floor(Math.log10(value));
  return size * [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12].find((m) => m * size >= value * 1.02);
};

function chartFrame(width, x, reach, xUnit, axis) {
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
  const ways = axis === 'direction';
  const marks = ways ? [-1, 0, 1] : xUnit === '°' ? [0, 90, 180, 270, 360].filter((v) => v >= x0 - 9 && v <= x1 + 9) : ticksOf(x0, x1);
  const clamp = (px) => Math.min(width - right, Math.max(left, px));
  const parts = [
    svg('line', {x1: left, x2: width - right, y1: atY(0), y2: atY(0), class: 'zero'}),
    ...[reach, 0, -reach].map((v) => tick(left - 5, atY(v) + 4, tickText(Number(v.toPrecision(3))), 'end')),
    ...marks.map((v, k) => {
      const last = k === marks.length - 1;
      const px = clamp(atX(v));
      const text = ways ? WAYS[k] : `${tickText(v)}${xUnit === '°' ? '°' : last ? ` ${xUnit}` : ''}`;
      return tick(px, CURVE_HEIGHT - 5, text, px > width - 40 ? 'end' : ways && px < 60 ? 'start' : 'middle');
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

/** RMS error of one output with its band; the dashed line is what every bin would have without structure. */
function channelPicture(where, name, one, width) {
  const middles = where.bins.slice(1).map((b, k) => (b + where.bins[k]) / 2);
  const known = middles.map((_, k) => k).filter((k) => one.rms[k] !== null);
  const [factor, letter] = prefix(one.overall, one.unit);
  const reach = niceReach(Math.max(...known.map((k) => one.high[k] ?? one.rms[k]), one.overall, 1e-300) * factor);
  const [left, right, top, bottom] = [38, 6, 22, 20];
  const [x0, x1] = [where.bins[0], where.bins.at(-1)];
  const atX = (v) => left + ((v - x0) / (x1 - x0 || 1)) * (width - left - right);
  const atY = (v) => top + (1 - Math.min(1, v / reach)) * (CURVE_HEIGHT - top - bottom);
  const frame = {atX, atY};
  const pick = (values) => middles.map((_, k) => (values[k] === null ? NaN : values[k] * factor));
  const [rms, low, high] = [one.rms, one.low, one.high].map(pick);
  const half = rms.map((_, k) => (high[k] - low[k]) / 2);
  const centre = rms.map((_, k) => (high[k] + low[k]) / 2);
  const tick = (px, py, text, anchor) => svg('text', {x: px, y: py, 'text-anchor': anchor, class: 'tick'}, text);
  const marks = where.axis === 'direction' ? [-1, 0, 1] : ticksOf(x0, x1);
  const even = isNoise(one);
  return svg('svg', {width, height: CURVE_HEIGHT, role: 'img',
    'aria-label': `RMS ${name.replace(/_/g, ' ')} error by ${where.axis}, ${digits(one.overall * factor)} ${letter}${unitText(one.unit)} in all${even ? ', the same everywhere within noise' : ''}.`},
  tick(0, 11, `${letter}${unitText(one.unit)}`, 'start'),
  svg('path', {class: 'band', d: bandOf(middles, centre, half, 1, frame)}),
  svg('line', {x1: left, x2: width - right, y1: atY(one.overall * factor), y2: atY(one.overall * factor), class: 'overall'}),
  svg('path', {class: even ? 'mean calm' : 'mean', d: pathOf(middles, rms, frame)}),
  even ? tick(width - 4, 11, 'even within noise', 'end') : null,
  tick(left - 5, atY(reach) + 4, tickText(reach), 'end'), tick(left - 5, atY(0) + 4, '0', 'end'),
  ...marks.map((v, k) => tick(Math.min(width - 8, atX(v)), CURVE_HEIGHT - 5, where.axis === 'direction'
    ? WAYS[k] : `${tickText(v)}${k === marks.length - 1 ? ` ${unitText(where.unit)}` : ''}`,
  k === marks.length - 1 ? 'end' : k === 0 && where.axis === 'direction' ? 'start' : 'middle')));
}

/** A map of signed or positive values, on the scale of the first model's; pale where it may be noise. */
function layerPicture(layer, first, width) {
  const [value, band] = [layer.value, layer.band].map(f32);
  const base = first.find((m) => m.quantity === layer.quantity) || layer;
  const reach = quantile(Array.from(f32(base.value), Math.abs), 0.98) || quantile(Array.from(value, Math.abs), 0.98) || 1;
  const [nx, ny] = [layer.x_edges.length - 1, layer.y_edges.length - 1];
  const [left, right, bottom] = [40, 6, 34];
  const [w, h] = [(width - left - right) / nx, (MAP_HEIGHT - 6) / ny];
  const [factor, letter] = prefix(reach, layer.unit);
  const text = (v) => `${digits(v * factor)} ${letter}${unitText(layer.unit)}`;
  const error = layer.quantity.endsWith(' error');
  const sure = (k) => error || Math.abs(value[k]) > band[k];
  const cells = svg('g', {});
  value.forEach((v, k) => {
    if (Number.isNaN(v)) return;
    const [row, column] = [Math.floor(k / nx), k % nx];
    const share = Math.min(1, Math.abs(v) / reach);
    const cell = svg('rect', {x: left + column * w, y: 6 + (ny - 1 - row) * h, width: w + 0.4, height: h + 0.4,
      class: `layer ${sure(k) ? (v < 0 ? 'below' : 'above') : 'unsure'}`, 'fill-opacity': sure(k) ? (0.15 + 0.85 * share).toFixed(2) : 1});
    cell.addEventListener('mousemove', (event) => tip.show(`${layer.x} ${digits(layer.x_edges[column])} … ${digits(layer.x_edges[column + 1])} ${unitText(layer.x_unit)}, `
      + `${layer.y} ${digits(layer.y_edges[row])} … ${digits(layer.y_edges[row + 1])} ${unitText(layer.y_unit)}: ${text(v)} ± ${text(band[k])}`, event));
    cell.addEventListener('mouseleave', () => tip.hide());
    cells.append(cell);
  });
  const label = (x, y, words, anchor) => svg('text', {x, y, 'text-anchor': anchor, class: 'tick'}, words);
  const [x0, x1, y0, y1] = [layer.x_edges[0], layer.x_edges[nx], layer.y_edges[0], layer.y_edges[ny]];
  const picture = svg('svg', {width, height: MAP_HEIGHT + bottom, role: 'img',
    'aria-label': `Map of the ${layer.quantity} by ${layer.x} and ${layer.y}, up to ${text(reach)}.`},
  svg('rect', {x: left, y: 6, width: nx * w, height: ny * h, class: 'frame'}), cells,
  ...ticksOf(x0, x1).map((v) => label(left + ((v - x0) / (x1 - x0)) * nx * w, MAP_HEIGHT + 13, tickText(v), 'middle')),
  ...ticksOf(y0, y1).map((v) => label(left - 5, 10 + (1 - (v - y0) / (y1 - y0)) * ny * h, tickText(v), 'end')),
  label(left + (nx * w) / 2, MAP_HEIGHT + 28, `${layer.x}${bracketed(layer.x_unit)}`, 'middle'),
  label(2, 12, unitText(layer.y_unit), 'start'));
  const key = error ? [text(0), el('span', {class: 'ramp plain', 'aria-hidden': 'true'}), text(reach)]
    : [text(-reach), el('span', {class: 'ramp both', 'aria-hidden': 'true'}), text(reach), '· grey: noise'];
  return [picture, el('p', {class: 'scale'}, ...key)];
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
  const ways = where.axis === 'direction';
  const marks = ways ? [-1, 0, 1] : ticksOf(x0, x1);
  return svg('svg', {width, height: CURVE_HEIGHT, role: 'img',
    'aria-label': `Error by ${where.axis}, at most ${percent(reach)}.`},
  tick(0, 11, '%', 'start'), ...bars.filter(Boolean), tick(left - 5, top + 4, digits(reach), 'end'), tick(left - 5, top + height, '0', 'end'),
  ...marks.map((v, k) => tick(Math.min(width - 8, atX(v)), CURVE_HEIGHT - 5,
    ways ? WAYS[k] : `${tickText(v)}${k === marks.length - 1 ? ` ${unitText(where.unit)}` : ''}`,
    k === marks.length - 1 ? 'end' : k === 0 && ways ? 'start' : 'middle')));
}
