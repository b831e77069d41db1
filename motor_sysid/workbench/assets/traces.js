'use strict';
/* Measured against model over time: uPlot panels with one zoom, one cursor, and marked moments. */

const AXIS_WIDTH = 56;
const RIGHT_GAP = 10;
const TIME_AXIS = 28;
/** Pixels from one number of a vertical axis to the next: less where the panel is low. */
const TICK_SPACE = (u, axis, low, high, height) => Math.min(22, Math.max(12, height / 3.5));
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];

/** The panels over time. What `kept` says of panels, error, stretch and range is as the user had it. */
function makeTraces(view, kept = {}) {
  const time = f64(view.time);
  const channels = Object.fromEntries(
    view.channels.map((c) => [c.key, {...c, values: withGaps(f32(c.values))}]));
  const regimes = view.regimes && {names: view.regimes.names, ids: u8(view.regimes.ids)};
  const unpack = (table) =>
    Object.fromEntries(Object.entries(table).map(([key, text]) => [key, withGaps(f32(text))]));
  const steps = view.steps.map((s) => ({model: unpack(s.model), error: unpack(s.error)}));
  const root = $('#plots');
  const trained = view.records.some((r) => r.role === 'train');
  const full = [view.records[0].start, view.records.at(-1).end];
  const shown = kept.shown || new Set(view.panels.filter((p) => p.shown).map((p) => p.key));
  let home = kept.home || view.focus;
  let range = kept.range || home;
  let state = {step: 0, ghost: null, errorOf: kept.errorOf || view.primary};
  let mark = null;
  let plots = [];

  /* Points between two records belong to neither; what comes before one ends with itself. */
  const tolerance = 1e-6 * (full[1] - full[0]);
  const recordAt = (t) => view.records.find((r) => t >= r.start - tolerance && t <= r.end + tolerance);
  const inside = (t) => view.records.some((r) => t >= r.start && t <= r.end);
  const joints = new Set(view.records.length > 1 ? Array.from(time.keys()).filter((k) => !inside(time[k])) : []);
  const firsts = view.records.map((r) => time.findIndex((t) => t >= r.start - tolerance));
  const endOf = (k) => (k + 1 < time.length && !joints.has(k + 1) ? time[k + 1] : time[k]);

  const drawStrip = () => strip(view, {time, regimes, endOf, range, stretchName, width: root.clientWidth});

  const errorOutputs = () => Object.keys(steps[0].error);
  const nothing = () => new Array(time.length).fill(null);

  /* What each panel draws: a title, a weight, and series of [label, values, style]. */
  function panelSpecs() {
    const specs = [];
    view.panels.forEach((panel, index) => {
      if (shown.has(panel.key)) specs.push(channelPanel(panel));
      if (index === 0 && steps[0].error[state.errorOf]) specs.push(errorPanel());
    });
    return specs;
  }

  function channelPanel(panel) {
    const series = [];
    const own = panel.channels.map((key) => channels[key]);
    const several = own.filter((c) => c.kind !== 'reference').length > 1;
    own.filter((c) => c.kind === 'reference').forEach((c) =>
      series.push({label: c.label, values: () => c.values, color: 'muted', width: 1, dash: [4, 4]}));
    own.filter((c) => c.kind !== 'reference').forEach((c, k) => {
      const name = several ? ` ${c.label}` : '';
      const output = c.kind === 'output';
      series.push({label: output ? `measured${name}` : c.label, values: () => c.values, dash: DASHES[k % 4],
        color: output ? 'measured' : 'input', width: output ? 3 : 1.2, stepped: panel.stepped});
      if (output) {
        series.push({label: `model${name}`, values: () => steps[state.step].model[c.key] || nothing(),
          color: 'model', width: 1.2, dash: DASHES[k % 4]});
      }
    });
    const weight = own.some((c) => c.kind === 'output') ? 1 : 0.8;
    return {key: panel.key, title: panel.title, unit: panel.unit, weight, series};
  }

  function errorPanel() {
    const channel = channels[state.errorOf];
    return {
      key: 'error', title: `${channel.key.replace(/_/g, ' ')} error`, unit: channel.unit, weight: 1.55,
      sigma: channel.sigma,
      series: [
        {label: 'ghost', color: 'ghost', width: 1.2,
          values: () => (state.ghost === null ? nothing() : steps[state.ghost].error[state.errorOf])},
        {label: 'error', values: () => steps[state.step].error[state.errorOf], color: 'error', width: 1.2},
      ],
    };
  }

  /** Which of several signals of one colour has which dashes. */
  function dashKeys({key, series}) {
    const own = series.filter((s) => s.color === 'measured' || s.color === 'input');
    if (key === 'error' || own.length < 2) return [];
    return own.map((s) => el('span', {class: 'dashes'}, svg('svg', {width: 26, height: 6, 'aria-hidden': 'true'},
      svg('line', {x1: 0, x2: 26, y1: 3, y2: 3, 'stroke-dasharray': s.dash.join(' ')})), s.label.replace('measured ', '')));
  }

  function options(spec, last) {
    const stroke = (name) => () => palette[name];
    const grid = {stroke: stroke('line'), width: 1};
    return {
      width: 600, height: 100, legend: {show: false}, pxAlign: 1,
      padding: [20, RIGHT_GAP, last ? 0 : 4, 0],
      scales: {x: {time: false}, y: {range: (u, low, high) => padded(low, high)}},
      cursor: {
        y: false, points: {show: false}, drag: {x: true, y: false, setScale: false, dist: 4},
        sync: {key: 'motor_sysid', setSeries: false, scales: ['x', null],
          filters: {pub: (type) => type !== 'mousedown' && type !== 'mouseup'}},
        bind: {
          mousedown: (u, target, handle) => (event) => (event.shiftKey ? startPan(u, event) : handle(event)),
          dblclick: () => () => zoom(home),
        },
      },
      axes: [
        {size: last ? TIME_AXIS : 0, stroke: stroke('muted'), grid, ticks: {...grid, size: 4},
          font: '11px system-ui, sans-serif', splits: roundTimes,
          values: (u, splits) => splits.map((t) => (last ? clockText(t) : ''))},
        {size: AXIS_WIDTH, stroke: stroke('muted'), grid, ticks: {...grid, size: 4}, space: TICK_SPACE,
          font: '11px system-ui, sans-serif', values: (u, splits) => splits.map(tickText)},
      ],
      series: [{}, ...spec.series.map((s) => ({
        label: s.label, stroke: stroke(s.color), width: s.width, dash: s.dash, points: {show: false},
        ...(s.stepped ? {paths: uPlot.paths.stepped({align: 1})} : {}),
      }))],
      hooks: {
        drawClear: [(u) => drawBehind(u, spec)],
        draw: [(u) => drawNoiseLimits(u, spec)],
        setSelect: [(u) => select(u)],
        setCursor: [(u) => readout(u, spec)],
        ready: [(u) => {
          u.over.addEventListener('wheel', (e) => wheel(u, e), {passive: false});
          u.over.addEventListener('pointerdown', (e) => touch(u, e));
        }],
      },
    };
  }

  const data = (spec) => [time, ...spec.series.map((s) => s.values())];

  function rebuild() {
    plots.forEach(({u}) => u.destroy());
    root.replaceChildren();
    const specs = panelSpecs();
    plots = specs.map((spec, k) => {
      const box = el('div', {class: 'plot', 'data-panel': spec.key},
        el('p', {class: 'name'}, `${spec.title}${bracketed(spec.unit)}`, ...dashKeys(spec)),
        el('p', {class: 'readout', 'aria-hidden': 'true'}));
      root.append(box);
      const u = new uPlot(options(spec, k === specs.length - 1), data(spec), box);
      return {u, spec, box};
    });
    resize();
    applyRange();
  }

  function resize() {
    const width = root.clientWidth;
    const height = root.clientHeight - TIME_AXIS;
    const total = plots.reduce((sum, {spec}) => sum + spec.weight, 0);
    plots.forEach(({u, spec}, k) => {
      const extra = k === plots.length - 1 ? TIME_AXIS : 0;
      u.setSize({width, height: Math.max(48, Math.floor((height * spec.weight) / total)) + extra});
    });
    drawMarks();
    drawStrip();
  }

  /* --- zoom: one range for all panels --------------------------------------------------- */

  function applyRange() {
    plots.forEach(({u}) => u.batch(() => u.setScale('x', {min: range[0], max: range[1]})));
    drawMarks();
    drawStrip();
  }

  function zoom([from, to]) {
    const least = Math.min(full[1] - full[0], 10 * pairStep(recordAt((from + to) / 2)));
    const width = Math.min(full[1] - full[0], Math.max(least, to - from));
    const middle = (from + to) / 2;
    const start = Math.min(Math.max(full[0], middle - width / 2), full[1] - width);
    range = [start, start + width];
    applyRange();
  }

  /** Time from one pair of points to the next. */
  const pairStep = (record) => {
    const rate = record?.rate_hz || Math.max(...view.records.map((r) => r.rate_hz || 1));
    return Math.max(2, record?.bucket || 1) / rate;
  };
  const zoomAt = (t, factor) => zoom([t - (t - range[0]) * factor, t + (range[1] - t) * factor]);
  const middle = () => (range[0] + range[1]) / 2;
  const pan = (share) => {
    const shift = share * (range[1] - range[0]);
    const bounded = Math.min(Math.max(shift, full[0] - range[0]), full[1] - range[1]);
    zoom([range[0] + bounded, range[1] + bounded]);
  };

  function select(u) {
    const {left, width} = u.select;
    if (width < 4) return;
    const picked = [u.posToVal(left, 'x'), u.posToVal(left + width, 'x')];
    u.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
    zoom(picked);
  }

  function wheel(u, event) {
    event.preventDefault();
    if (!event.deltaY) {
      pan(0.1 * Math.sign(event.deltaX));
      return;
    }
    const t = u.posToVal(event.clientX - u.over.getBoundingClientRect().left, 'x');
    zoomAt(t, event.deltaY < 0 ? 0.75 : 1 / 0.75);
  }

  /** A finger does not hover: where it touches is read out. */
  function touch(u, event) {
    if (event.pointerType !== 'touch') return;
    const left = event.clientX - u.over.getBoundingClientRect().left;
    plots.forEach(({u: each}) => each.setCursor({left, top: 1}));
  }

  function startPan(u, event) {
    const from = event.clientX;
    const start = range;
    const perPixel = (range[1] - range[0]) / u.over.clientWidth;
    const move = (e) => {
      range = start;
      pan((-(e.clientX - from) * perPixel) / (start[1] - start[0]));
    };
    const stop = () => {
      removeEventListener('mousemove', move);
      removeEventListener('mouseup', stop);
    };
    addEventListener('mousemove', move);
    addEventListener('mouseup', stop);
  }

  const KEYS = {
    ArrowLeft: () => pan(-0.2), ArrowRight: () => pan(0.2), 0: () => zoom(home),
    '+': () => zoomAt(middle(), 0.6), '=': () => zoomAt(middle(), 0.6),
    '-': () => zoomAt(middle(), 1 / 0.6), '−': () => zoomAt(middle(), 1 / 0.6),
  };
  function key(event) {
    const action = KEYS[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  }

  /* --- drawing behind the lines --------------------------------------------------------- */

  function drawBehind(u, spec) {
    const {ctx} = u;
    const {left, top, width, height} = u.bbox;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    const x = (t) => u.valToPos(t, 'x', true);
    ctx.fillStyle = palette.train;
    const judged = view.records.some((r) => r.role !== 'train');
    view.records.filter((r) => judged && r.role === 'train').forEach((r) =>
      ctx.fillRect(x(r.start), top, x(r.end) - x(r.start), height));
    ctx.fillStyle = palette.joint;
    view.records.slice(1).forEach((r) => ctx.fillRect(Math.round(x(r.start)) - 1, top, 1.5, height));
    if (spec.sigma) {
      const [low, high] = [-2, 2].map((k) => u.valToPos(k * spec.sigma, 'y', true));
      ctx.fillStyle = palette.noise;
      ctx.fillRect(left, high, width, low - high);
    }
    ctx.restore();
  }

  /** Marked moments, on canvases of their own behind the lines: those need not be drawn again. */
  function drawMarks() {
    const spans = mark ? markedSpans().filter(([a, b]) => b >= range[0] && a <= range[1]) : [];
    plots.forEach(({u}) => {
      const canvas = $('canvas', u.under) || u.under.appendChild(el('canvas', {class: 'marks'}));
      const [width, height] = [u.under.clientWidth, u.under.clientHeight];
      if (canvas.width !== width) canvas.width = width;
      if (canvas.height !== height) canvas.height = height;
      const ctx = canvas.getContext('2d');
      ctx.clearRect(0, 0, width, height);
      ctx.fillStyle = palette.mark;
      const x = (t) => ((t - range[0]) / (range[1] - range[0])) * width;
      spans.forEach(([a, b]) => ctx.fillRect(x(a), 0, Math.max(1.5, x(b) - x(a)), height));
    });
  }

  /** Where ±2σ lies, on top of an error that hides the band. */
  function drawNoiseLimits(u, spec) {
    if (!spec.sigma) return;
    const {ctx} = u;
    const {left, top, width, height} = u.bbox;
    ctx.save();
    ctx.strokeStyle = palette.ok;
    ctx.lineWidth = devicePixelRatio || 1;
    ctx.setLineDash([5, 4]);
    [-2, 2].map((k) => u.valToPos(k * spec.sigma, 'y', true))
      .filter((y) => y > top && y < top + height).forEach((y) => {
        ctx.beginPath();
        ctx.moveTo(left, y);
        ctx.lineTo(left + width, y);
        ctx.stroke();
      });
    ctx.restore();
  }

  /** Stretches of time whose points bear the marked id. */
  function markedSpans() {
    const spans = [];
    for (let k = 0; k < time.length; k += 1) {
      if (mark.ids[k] !== mark.id) continue;
      if (spans.length && spans.at(-1)[1] === time[k]) spans.at(-1)[1] = endOf(k);
      else spans.push([time[k], endOf(k)]);
    }
    return spans;
  }

  /* --- text ------------------------------------------------------------------------------ */

  function stretchName(record) {
    const role = record.role === 'train' ? 'training' : trained ? 'held out' : 'validation';
    return record.label ? `${record.label} · ${role}` : role;
  }

  function clockText(t) {
    const record = recordAt(t);
    return record ? `${minus(String(Number((t - record.clock).toFixed(6))))} s` : '';
  }

  /** Times about so many seconds apart that are round since the start of their recording. */
  function roundTimes(u, axis, low, high, step) {
    const found = [];
    for (const {start, end, clock} of view.records) {
      for (let k = Math.ceil((Math.max(low, start) - tolerance - clock) / step);
        clock + k * step < Math.min(high, end) + tolerance; k += 1) {
        if (!(clock + k * step - found.at(-1) < 0.8 * step)) found.push(clock + k * step);
      }
    }
    return found;
  }

  function readout(u, spec) {
    const node = $('.readout', u.root.parentNode);
    const k = u.cursor.idx;
    if (k === null || k === undefined || u.cursor.left < 0) {
      node.textContent = '';
      return;
    }
    const at = plots[0]?.u === u ? [clockText(time[k])] : [];
    const values = spec.series
      .map((s, n) => [s.label, pointsAt(k).map((p) => u.data[n + 1][p]).filter((v) => v !== null && v !== undefined)])
      .filter(([, found]) => found.length)
      .map(([label, found]) => `${label === 'ghost' ? `M${state.ghost}` : label} ${span(found)}`);
    node.textContent = [...at, ...values].join(' · ');
  }

  /** The points that stand for the same samples as point k: a pair, in the order of each signal. */
  function pointsAt(k) {
    const record = recordAt(time[k]);
    if (!record || record.bucket < 2 || joints.has(k)) return [k];
    const first = firsts[view.records.indexOf(record)];
    const even = k - ((k - first) % 2);
    return [even, even + 1].filter((p) => p < time.length && !joints.has(p));
  }

  /** A value, or the smallest and the largest of several samples. */
  function span(found) {
    const [low, high] = [Math.min(...found), Math.max(...found)].map((v) => digits(v, 4));
    return low === high ? low : `${low} … ${high}`;
  }

  const api = {
    show(next) {
      const rebuilt = next.errorOf !== undefined && next.errorOf !== state.errorOf;
      state = {...state, ...next};
      if (rebuilt || !plots.length) {
        rebuild();
        return;
      }
      plots.forEach(({u, spec}) => u.setData(data(spec), false));
      applyRange();
    },
    mark(ids, id) {
      if (mark?.ids === (ids || undefined) && mark?.id === id) return;
      mark = ids ? {ids, id} : null;
      drawMarks();
    },
    /** What a panel draws, by label. */
    lines: (name) => Object.fromEntries(
      plots.find(({spec}) => spec.key === name).spec.series.map((s) => [s.label, s.values()])),
    /** Indices of the marked points. */
    marked: () => (mark ? Array.from(time.keys()).filter((k) => mark.ids[k] === mark.id) : []),
    range: () => range,
    cursor: () => plots[0].u.cursor.idx,
    times: () => plots.at(-1).u.axes[0]._values,
    ranges: () => plots.map(({u}) => [u.scales.x.min, u.scales.x.max]),
    go(from, to) {
      home = [from, to];
      zoom(home);
    },
    look: (wanted) => zoom(wanted),
    all: () => full,
    /** What the user has chosen, for the traces that come after these. */
    kept: () => ({shown, home, range, errorOf: state.errorOf}),
    isShown: (panel) => shown.has(panel),
    destroy: () => plots.forEach(({u}) => u.destroy()),
    toggle(panel, on) {
      if (on) shown.add(panel);
      else shown.delete(panel);
      rebuild();
    },
    pan,
    zoomIn: () => zoomAt(middle(), 0.6),
    zoomOut: () => zoomAt(middle(), 1 / 0.6),
    reset: () => zoom(home),
    recolor() {
      drawMarks();
      plots.forEach(({u}) => u.redraw(false, true));
      drawStrip();
    },
    errorOutputs, resize, key, stretchName, regimes,
  };
  return api;
}
