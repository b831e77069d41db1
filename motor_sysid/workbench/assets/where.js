'use strict';
/* Where the model fails: a map of two signals, shares by regime, and curves along one axis. */

function makeWhere(view, mark, kept = {}) {
  const map = view.map && {...view.map, ids: u16(view.map.ids), counts: u32(view.map.counts)};
  const layers = view.steps.map((s) => f32(s.map));
  const heat = heatScale(map, layers, view.channels.find((c) => c.key === view.primary)?.unit || '');
  let step = 0;
  const chosen = kept.chosen || [null, null];
  let layer = kept.layer || null;

  /* --- map ------------------------------------------------------------------------------- */

  function drawMap() {
    const others = view.steps[step].maps.filter((m) => !map || m.quantity !== `${view.primary} error`);
    $('#map-figure').hidden = !map && !others.length;
    if (!map && !others.length) return;
    const shown = others.find((m) => m.quantity === layer) || (map ? null : others[0]);
    mapTitle(others, shown);
    if (shown) $('#map').replaceChildren(...layerPicture(shown, view.steps[0].maps, Math.max(180, $('#map').clientWidth)));
    else drawErrorMap();
  }

  /** What the map shows: chosen where there is more than one. */
  function mapTitle(others, shown) {
    const title = (quantity, x, y) => `${quantity.replace(/_/g, ' ')} by ${x} and ${y.replace(/_/g, ' ')}`;
    const own = map ? [['', title(`${view.primary} error`, map.x, map.y)]] : [];
    const choices = [...own, ...others.map((m) => [m.quantity, title(m.quantity, m.x, m.y)])];
    if (choices.length < 2) {
      $('#map-title').textContent = choices[0][1];
      return;
    }
    const picker = el('select', {'aria-label': 'Map', onchange: (event) => {
      layer = event.target.value || null;
      drawMap();
      $('#map-title select').focus();
    }}, choices.map(([key, text]) => el('option', {value: key, selected: key === (shown ? shown.quantity : '')}, text)));
    $('#map-title').replaceChildren(picker);
  }

  function drawErrorMap() {
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
    $('#regime-title').textContent = Object.keys(view.steps[step].error).length > 1
      ? 'squared error by regime, all outputs' : 'squared error by regime';
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

  /** Curves count time over the records they are made of, one after the other. */
  const held = new Set(view.records.map((r) => r.role)).size > 1;
  const several = new Set(view.records.map((r) => r.source)).size > 1;
  const axisText = (axis, judged) => (axis !== 'time' ? axis
    : judged && held ? 'time in the held-out data' : several ? 'time over all data' : axis);

  function curveChoices() {
    const {curves, where} = view.steps[step];
    const told = [...curves].sort((a, b) => isNoise(a) - isNoise(b) || (a.axis === 'direction') - (b.axis === 'direction'));
    return [
      ...told.map((c) => {
        const reach = commonReach(c);
        return {key: keyOf(c), title: `${c.quantity} by ${axisText(c.axis, false)}${isNoise(c) ? ' (noise)' : ''}`,
          draw: (w) => curvePicture(withLaw(c), w, reach)};
      }),
      ...where.flatMap((r) => Object.entries(r.channels).map(([name, one]) => ({
        key: `${name}:${r.axis}`, title: `RMS ${name.replace(/_/g, ' ')} error by ${axisText(r.axis, true)}${isNoise(one) ? ' (even)' : ''}`,
        draw: (w) => channelPicture(r, name, one, w)}))),
      ...where.map((r) => ({key: `error:${r.axis}`, title: `error by ${axisText(r.axis, true)}`,
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
      parts.push(table('Error by regime', ['regime', 'of error', 'of time', 'error'],
        shares.map((r) => [r.name, share(r.error_share), share(r.time_share), percent(r.error_percent ?? null)])));
    }
    if (map) {
      parts.push(table('Worst cells of the map', ['where', 'RMS error', 'samples'],
        worstCells().map((k) => [cellText(k), heat.text(layers[step][k]), String(map.counts[k])])));
    }
    view.steps[step].where.forEach((r) => parts.push(table(`Error by ${r.axis}`,
      [`${r.axis}${bracketed(r.unit)}`, 'error', 'of error', 'of time'],
      r.error_percent.map((v, k) => [binText(r, k), percent(v),
        share(r.error_share[k]), share(r.time_share[k])]))));
    view.steps[step].where.forEach((r) => Object.entries(r.channels).forEach(([name, one]) =>
      parts.push(channelTable(r, name, one))));
    view.steps[step].curves.forEach((c) => parts.push(curveTable(c)));
    $('#numbers > div').replaceChildren(...parts);
  }

  const binText = (r, k) => (r.axis === 'direction' ? WAYS[k] : `${digits(r.bins[k])} … ${digits(r.bins[k + 1])}`);

  function channelTable(r, name, one) {
    return table(`RMS ${name.replace(/_/g, ' ')} error by ${r.axis}, ${digits(one.overall)} ${unitText(one.unit)} in all`,
      [`${r.axis}${bracketed(r.unit)}`, `RMS${bracketed(one.unit)}`, '95 % band'],
      one.rms.map((v, k) => [binText(r, k), digits(v),
        v === null ? '–' : `${digits(one.low[k])} … ${digits(one.high[k])}`]));
  }

  function curveTable(curve) {
    const [x, mean, band] = [curve.x, curve.mean, curve.band].map(f32);
    const rows = Array.from(x.keys()).filter((k) => Number.isFinite(mean[k]));
    const every = Math.max(1, Math.ceil(rows.length / 16));
    return table(cap(`${curve.quantity} by ${curve.axis}${isNoise(curve) ? ', no more than noise' : ''}`),
      [`${curve.axis}${bracketed(curve.axis_unit)}`, `mean${bracketed(curve.unit)}`, '± 95 %'],
      rows.filter((_, n) => n % every === 0).map((k) => [digits(x[k]), digits(mean[k]), digits(band[k])]));
  }

  return {
    show(index) {
      step = index;
      $('#where-note').textContent = held ? 'errors: held out · unexplained: all data' : '';
      drawMap();
      drawRegimes();
      drawCurves();
      drawNumbers();
    },
    redraw() {
      heat.recolor();
      this.show(step);
    },
    /** Which curves and which map the user has chosen. */
    kept: () => ({chosen, layer}),
    map,
  };
}
