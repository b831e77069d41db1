'use strict';
/* The verdict in words, the ladder of errors, and stepping through the models. */

function drawHeadline(view) {
  const {verdict} = view;
  const [first, last] = [view.steps[0], view.steps[view.last ?? view.steps.length - 1]];
  const fall = first !== last
    ? [' Error ', el('b', {class: 'figure bad'}, brief(first.validation_error_percent)), ' → ',
      el('b', {class: settled(view, last) ? 'figure ok' : 'figure'}, brief(last.validation_error_percent)),
      `, noise floor ${brief(view.noise_floor_percent)}.`]
    : likeness(verdict);
  $('#headline').replaceChildren(
    el('span', {class: `badge ${verdict.key}`}, verdict.key.replace(/_/g, ' ')), ' ', el('b', {}, `${verdict.title}.`), ...fall);
  drawWhy(verdict, fall.length > 0);
  const experiment = verdict.experiment;
  $('#experiment').hidden = !experiment;
  if (experiment) {
    $('#experiment').replaceChildren(el('b', {}, 'Record next: '),
      `${Object.values(experiment).join(', ')}.`);
  }
}

/** What something unknown looks like, in a few words. */
function likeness({key, unknown}) {
  const found = key === 'unknown_effect' && unknown.find((u) => u.axis);
  if (!found) return [];
  if (found.axis.includes(' over ')) return [` It looks like ${found.axis.replace(' over ', ' changing over ')}.`];
  if (found.axis === 'constant') return [` The ${found.quantity} is a constant.`];
  const shape = found.shape && found.shape !== found.axis ? `: ${found.shape}` : '';
  return [` The ${found.quantity} looks like a function of ${found.axis}${shape}.`];
}

const brief = (value) => (value === null ? '–' : `${digits(value, 2)} %`);

/** The reasons; the first one is left out where it only repeats the headline. */
function drawWhy({reasons, warnings}, told) {
  const repeats = told && reasons.length > 1 && reasons[0].startsWith('Missing:');
  const lines = [...(repeats ? reasons.slice(1) : reasons), ...warnings.map((w) => `Note: ${w}`)];
  const why = $('#why');
  why.hidden = !lines.length;
  if (!lines.length) return;
  const more = lines.length > 1 ? ` (${lines.length - 1} more)` : '';
  $('summary', why).replaceChildren(`Why: ${symbols(lines[0])}`, el('span', {class: 'count'}, more));
  $('ul', why).replaceChildren(...lines.slice(1).map((line) => el('li', {}, symbols(line))));
}

/** Whether a model is as good as its data, and the verdict says so: nothing improves it, and noise alone is left. */
const settled = (view, s) => !s.candidates.some((c) => c.passes)
  && (view.verdict.key === 'complete'
    || (view.verdict.key === 'effect_missing' && s.times_floor !== null && s.times_floor <= 1.3));

const nothingPasses = (view, s) => (settled(view, s)
  ? ['No candidate improves it: ', el('b', {class: 'ok'}, 'stop here'), '.']
  : ['No candidate of the catalogue improves it.']);

/** One model in words: how bad, where worst, what explains it best. */
function drawNow(view, step) {
  const s = view.steps[step];
  const done = settled(view, s);
  const parts = [el('b', {}, `${s.name} · ${effectsText(view, s)}`), ': error ',
    el('b', {class: done ? 'figure ok' : 'figure bad'}, brief(s.validation_error_percent))];
  parts.push(s.times_floor === null ? '. ' : `, ${times(s.times_floor)} the noise floor. `);
  parts.push(...worstRegime(s));
  const best = bestOf(s);
  if (best) {
    const after = best.validation_error_percent ?? NaN;
    const change = Math.round(100 * (after / s.validation_error_percent - 1));
    parts.push(explains(view, step) ? 'Best explanation: ' : 'Nearest, but not enough to be named: ', el('b', {}, cap(best.title)),
      Number.isFinite(change) ? `, error ${change > 0 ? '+' : MINUS}${Math.abs(change)} %.` : '.');
  } else if (s.candidates.length) {
    parts.push(...nothingPasses(view, s));
  }
  $('#now').replaceChildren(...parts);
}

/** Whether what passes on a model is an explanation. Where the verdict names nothing, it is only near. */
const explains = ({verdict, last}, step) => ['effect_missing', 'ambiguous'].includes(verdict.key)
  || (verdict.key === 'complete' && step > last);

/** The candidate that was taken, else the best that passes; what was added by hand need not be good. */
const bestOf = (s) => s.candidates.find((c) => c.added && (c.passes || !c.by_hand)) || s.candidates.find((c) => c.passes);

/** The regime with the most error beyond its share of time, if one stands out. */
function worstRegime(s) {
  const rows = s.regimes.filter((r) => r.time_share > 0 && r.error_share >= 0.05);
  const excess = (r) => r.error_share - r.time_share;
  const [worst] = rows.sort((a, b) => excess(b) - excess(a));
  if (!worst) return [];
  if (worst.error_share / worst.time_share < 1.25) return ['Spread evenly over the regimes. '];
  return ['Worst at ', el('b', {}, worst.name),
    `: ${share(worst.error_share)} of the error in ${share(worst.time_share)} of the time. `];
}

/* --- ladder ------------------------------------------------------------------------------ */

function drawLadder(view, step, onPick) {
  const box = $('#ladder');
  const width = Math.max(240, box.clientWidth);
  const height = 62;
  const floor = view.noise_floor_percent;
  const errors = view.steps.map((s) => s.validation_error_percent);
  const known = [...errors, floor].filter((v) => v > 0);
  const [low, high] = [Math.min(...known) / 1.6, Math.max(...known) * 1.15];
  const [left, right] = [8, width - 34];
  const at = (v) => left + (Math.log(Math.max(v, low) / low) / Math.log(high / low)) * (right - left);
  const y = 36;
  const parts = [svg('line', {x1: left, x2: right, y1: y, y2: y, class: 'rail'})];
  if (floor > 0) {
    parts.push(svg('rect', {x: left, y: y - 6, width: at(floor) - left, height: 12, rx: 3, class: 'floor'}),
      svg('text', {x: left, y: y + 22, class: 'tick'}, `sensor noise ${brief(floor)}`));
  }
  const title = width < 400 ? 'error, log.' : 'error on held-out data, logarithmic';
  parts.push(svg('text', {x: width - 2, y: y + 22, 'text-anchor': 'end', class: 'tick'}, title));
  const way = wayTo(view, step);
  for (let k = 1; k < errors.length; k += 1) {
    const from = errors[parentOf(view, k)];
    if (from > 0 && errors[k] > 0) parts.push(hop(at(from), at(errors[k]), y, way.has(k)));
  }
  parts.push(...dots(view, errors, step, at, y, width, onPick));
  const words = view.steps.map((s) => `${s.name} ${percent(s.validation_error_percent)}`).join(', ');
  box.setAttribute('aria-label', `Ladder of errors on held-out data: ${words}; sensor noise ${percent(floor)}.`);
  box.replaceChildren(svg('svg', {width, height, 'aria-hidden': 'true'}, ...parts));
}

/** The model that one was made from. */
const parentOf = (view, step) => (step === 0 ? null : view.steps[step].parent ?? step - 1);

/** The models on the way to one. */
function wayTo(view, step) {
  const way = new Set();
  for (let k = step; k !== null; k = parentOf(view, k)) way.add(k);
  return way;
}

const hop = (from, to, y, done) => svg('line', {x1: from, x2: to, y1: y, y2: y, class: done ? 'hop done' : 'hop'});

/** Dots with labels above them; a label that would overlap its neighbour keeps only its name. */
function dots(view, errors, step, at, y, width, onPick) {
  const order = errors.map((_, k) => k).filter((k) => errors[k] > 0).sort((a, b) => (a === step ? 1 : b === step ? -1 : 0));
  const taken = [];
  const labels = [];
  const marks = [];
  [...order].reverse().forEach((k) => {
    const text = `M${k} ${brief(errors[k])}`;
    const place = labelPlace(at(errors[k]), text, taken, width) || labelPlace(at(errors[k]), `M${k}`, taken, width);
    if (place) labels.push(svg('text', {x: place.x, y: place.y, 'text-anchor': 'middle',
      class: k === step ? 'dot-label current' : 'dot-label'}, place.text));
  });
  order.forEach((k) => marks.push(svg('circle', {cx: at(errors[k]), cy: y, r: k === step ? 7 : 5,
    class: `dot ${k === step ? 'current' : ''} ${settled(view, view.steps[k]) ? 'ok' : ''}`,
    'data-model': k, onclick: () => onPick(k)})));
  return [...labels, ...marks];
}

function labelPlace(x, text, taken, width) {
  const half = text.length * 3.6 + 3;
  const middle = Math.min(width - half, Math.max(half, x));
  for (const y of [22, 9]) {
    if (!taken.some((t) => t.y === y && Math.abs(t.x - middle) < t.half + half)) {
      taken.push({x: middle, y, half});
      return {x: middle, y, text};
    }
  }
  return null;
}

/* --- stepper ----------------------------------------------------------------------------- */

function drawStepper(view, step, onPick) {
  const box = $('#stepper');
  if (box.querySelectorAll('input').length !== view.steps.length) {
    box.querySelectorAll('label').forEach((label) => label.remove());
    view.steps.forEach((s, k) => box.append(el('label', {title: effectsText(view, s)},
      el('input', {type: 'radio', name: 'model', value: k, onchange: () => onPick(k)}), el('span', {}, s.name))));
  }
  box.querySelectorAll('input').forEach((input, k) => {
    input.checked = k === step;
  });
  if (box.contains(document.activeElement)) $(':checked', box).focus();
  $('.steps').classList.toggle('single', view.steps.length < 2);
  $('#back').disabled = step === 0;
  $('#forward').disabled = step === view.steps.length - 1;
}
