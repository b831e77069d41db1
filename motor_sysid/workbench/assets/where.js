'use strict';
/* Where the model fails: a map of two signals, shares by regime, and curves along one axis. */

const MAP_HEIGHT = 138;
const CURVE_HEIGHT = 122;

function makeWhere(view, mark) {
  const map = view.map && {...view.map, ids: u16(view.map.ids), counts: u32(view.map.counts)};
  const layers = view.steps.map((s) => f32(s.map));
  const heat = heatScale(map, layers, view.channels.find((c) => c.key === view.primary)?.unit || '');
  let step = 0;
  const chosen = [null, null];

  /* --- map ------------------------------------------------------------------------------- */

  function drawMap() {
    $('#map-figure').hidden = !map;
    if (!map) return;
    const output = view.primary.replace(/_/g, ' ');
    $('#map-title').textContent = `${output} error by ${map.x} and ${map.y.replace(/_/g, ' ')}`;
    const box = $('#map');
    const width = Math.max(180, box.clientWidth);
    const [left, bottom, right] = [40, 34, 6];
    const nx = map.x_edges.length - 1;
    const ny = map.y_edges.length - 1;
    const w = (width - left - right) / nx;
    const h = (MAP_HEIGHT - 6) / ny;
    const cells = svg('g', {});
    layers[step].forEach((value, k) => {
      if (Number.isNaN(value)) return;
      const [row, column] = [Math.floor(k / nx), k % nx];
      cells.append(svg('rect', {x: left + column * w, y: 6 + (ny - 1 - row) * h, width: w + 0.4,
        height: h + 0.4, fill: heat.color(value), 'data-cell': k}));
    });
    const label = (x, y, text, anchor) =>
      svg('text', {x, y, 'text-anchor': anchor, class: 'tick'}, text);
    const [x0, x1] = [map.x_edges[0], map.x_edges[nx]];
    const [y0, y1] = [map.y_edges[0], map.y_edges[ny]];
    const atX = (v) => left + ((v - x0) / (x1 - x0)) * nx * w;
    const atY = (v) => 6 + (1 - (v - y0) / (y1 - y0)) * ny * h;
    const picture = svg('svg', {width, height: MAP_HEIGHT + bottom, role: 'img',
      'aria-label': `${mapSentence()} The same numbers are in the tables below.`},
    svg('rect', {x: left, y: 6, width: nx * w, height: ny * h, class: 'frame'}), cells,
    ...ticksOf(x0, x1).map((v) => label(atX(v), MAP_HEIGHT + 13, tickText(v), 'middle')),
    ...ticksOf(y0, y1).map((v) => label(left - 5, atY(v) + 4, tickText(v), 'end')),
    label(left + (nx * w) / 2, MAP_HEIGHT + 28, `${map.x}${bracketed(map.x_unit)}`, 'middle'),
    label(2, 12, unitText(map.y_unit), 'start'));
    picture.addEventListener('mousemove', hoverMap);
    picture.addEventListener('mouseleave', leave);
    box.replaceChildren(picture, ...(worstCells().length ? [heatLegend()] : []));
  }

  function hoverMap(event) {
    const cell = event.target.dataset.cell;
    if (cell === undefined) {
      leave();
      return;
    }
    tip.show(`${cellText(Number(cell))}: ${heat.text(layers[step][cell])}, ${map.counts[cell]} samples`, event);
    mark(map.ids, Number(cell));
  }

  function leave() {
    tip.hide();
    mark(null);
  }

  function cellText(cell) {
    const nx = map.x_edges.length - 1;
    const [row, column] = [Math.floor(cell / nx), cell % nx];
    const span = (edges, k, unit) =>
      `${digits(edges[k], 3)} … ${digits(edges[k + 1], 3)} ${unitText(unit)}`;
    return `${map.x} ${span(map.x_edges, column, map.x_unit)}, ` +
      `${map.y.replace(/_/g, ' ')} ${span(map.y_edges, row, map.y_unit)}`;
  }

  const worstCells = () =>
    Array.from(layers[step].keys()).filter((k) => !Number.isNaN(layers[step][k]))
      .sort((a, b) => layers[step][b] - layers[step][a]).slice(0, 6);

  function mapSentence() {
    const [worst] = worstCells();
    return worst === undefined ? 'Map of the error: no cell has enough samples.'
      : `Map of the error. Largest at ${cellText(worst)}: ${heat.text(layers[step][worst])}.`;
  }

  function heatLegend() {
    const bar = el('span', {class: 'ramp', 'aria-hidden': 'true'});
    return el('p', {class: 'scale'}, heat.text(heat.low, true), bar, heat.text(heat.high));
  }

  /* --- regimes --------------------------------------------------------------------------- */

  function drawRegimes() {
    const shares = view.steps[step].regimes;
    $('#regime-figure').hidden = !shares.length;
    const ids = view.regimes && u8(view.regimes.ids);
    const most = Math.max(...shares.map((r) => Math.max(r.error_share, r.time_share)), 0.01);
    $('#regimes').replaceChildren(...shares.map((r, k) => {
      const on = (event) => {
        tip.hide();
        mark(ids, k);
        event.currentTarget.classList.add('lit');
      };
      const off = (event) => {
        mark(null);
        event.currentTarget.classList.remove('lit');
      };
      return el('button', {type: 'button', class: 'regime', 'data-regime': k, onmouseenter: on, onmouseleave: off,
        onfocus: on, onblur: off},
      el('span', {class: 'regime-name'}, el('i', {class: `key regime-${k}`}), r.name),
      bar(`regime-${k}`, r.error_share / most, `${share(r.error_share)} of error`),
      bar('time', r.time_share / most, `${share(r.time_share)} of time`));
    }));
  }

  function bar(kind, size, text) {
    const fill = el('i', {class: `fill ${kind}`});
    fill.style.width = `calc((100% - var(--text-room)) * ${Math.min(1, size || 0).toFixed(3)})`;
    return el('span', {class: `share ${kind === 'time' ? 'small' : ''}`}, fill, el('span', {}, text));
  }

  /* --- curves ---------------------------------------------------------------------------- */

  function curveChoices() {
    const {curves, where} = view.steps[step];
    return [
      ...curves.map((c) => {
        const reach = commonReach(c);
        return {key: keyOf(c), title: `${c.quantity} by ${c.axis}`,
          draw: (w) => curvePicture(withLaw(c), w, reach)};
      }),
      ...where.map((r) => ({key: `error:${r.axis}`, title: `error by ${r.axis}`,
        draw: (w) => wherePicture(r, w)})),
    ];
  }

  /** How far a picture reaches: its own curve, yet not so much closer than M0's that all looks alike. */
  function commonReach(curve) {
    const base = view.steps[0].curves.find((c) => keyOf(c) === keyOf(curve));
    return Math.max(reachOf(curve), base ? 0.3 * reachOf(base) : 0) || 1;
  }

  /** A curve with the law that explains it best: its own, or the best candidate's on that axis. */
  function withLaw(curve) {
    const rivals = view.steps[step].candidates.filter((c) =>
      c.passes && c.curve && c.curve.law && c.curve.axis === curve.axis && c.curve.quantity === curve.quantity);
    rivals.sort((a, b) => Boolean(b.added) - Boolean(a.added));
    const name = rivals.length ? cap(rivals[0].title) : '';
    if (curve.law || !rivals.length) return {...curve, name: name || 'best law'};
    return {...rivals[0].curve, name};
  }

  function drawCurves() {
    const choices = curveChoices();
    const preferred = choices.map((c) => c.key);
    const slots = Math.min(2, choices.length);
    $('#curves').hidden = !slots;
    $('#curves').replaceChildren(...Array.from({length: slots}, (_, slot) => {
      if (!preferred.includes(chosen[slot])) {
        chosen[slot] = preferred.find((k) => !chosen.slice(0, slot).includes(k)) || preferred[0];
      }
      return curveFigure(choices, slot);
    }));
    $('#curves').querySelectorAll('figure').forEach((figure, slot) => drawInto(figure, choices, slot));
  }

  function curveFigure(choices, slot) {
    const picker = choices.length > 2
      ? el('select', {'aria-label': `Curve ${slot + 1}`, onchange: (event) => {
        chosen[slot] = event.target.value;
        drawInto(event.target.closest('figure'), choices, slot);
      }}, choices.map((c) => el('option', {value: c.key, selected: c.key === chosen[slot]}, c.title)))
      : choices[slot].title;
    return el('figure', {}, el('figcaption', {}, picker), el('div', {class: 'curve'}));
  }

  function drawInto(figure, choices, slot) {
    const choice = choices.find((c) => c.key === chosen[slot]) || choices[0];
    const box = $('.curve', figure);
    box.replaceChildren(choice.draw(Math.max(180, box.clientWidth)));
  }

  /* --- tables for those who cannot see the pictures --------------------------------------- */

  function drawNumbers() {
    const shares = view.steps[step].regimes;
    const parts = [];
    if (shares.length) {
      parts.push(table('Error by regime', ['regime', 'of error', 'of time', 'RMS error'],
        shares.map((r) => [r.name, share(r.error_share), share(r.time_share), digits(r.rms)])));
    }
    if (map) {
      parts.push(table('Worst cells of the map', ['where', 'RMS error', 'samples'],
        worstCells().map((k) => [cellText(k), heat.text(layers[step][k]), String(map.counts[k])])));
    }
    view.steps[step].where.forEach((r) => parts.push(table(`Error by ${r.axis}`,
      [`${r.axis}${bracketed(r.unit)}`, 'error', 'of error', 'of time'],
      r.error_percent.map((v, k) => [`${digits(r.bins[k])} … ${digits(r.bins[k + 1])}`, percent(v),
        share(r.error_share[k]), share(r.time_share[k])]))));
    view.steps[step].curves.forEach((c) => parts.push(curveTable(c)));
    $('#numbers > div').replaceChildren(...parts);
  }

  function curveTable(curve) {
    const [x, mean, band] = [curve.x, curve.mean, curve.band].map(f32);
    const rows = Array.from(x.keys()).filter((k) => Number.isFinite(mean[k]));
    const every = Math.max(1, Math.ceil(rows.length / 16));
    return table(cap(`${curve.quantity} by ${curve.axis}`),
      [`${curve.axis}${bracketed(curve.axis_unit)}`, `mean${bracketed(curve.unit)}`, '± 95 %'],
      rows.filter((_, n) => n % every === 0).map((k) => [digits(x[k]), digits(mean[k]), digits(band[k])]));
  }

  return {
    show(index) {
      step = index;
      const roles = new Set(view.records.map((r) => r.role));
      $('#where-note').textContent = roles.size > 1 ? 'on the held-out data' : '';
      drawMap();
      drawRegimes();
      drawCurves();
      drawNumbers();
    },
    redraw() {
      heat.recolor();
      this.show(step);
    },
    map,
  };
}

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
  const [left, right, top, bottom] = [38, 6, 16, 20];
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
  const [left, right, top, bottom] = [38, 6, 16, 20];
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
