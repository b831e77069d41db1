'use strict';
/* What is missing, the models so far, and the parameters of one model. */

const SHORT_LIST = 7;

/** A button that changes the model. What is pressed stays where the keyboard finds it: it is not disabled. */
const actButton = (attributes, text) => el('button', {type: 'button', class: 'act', ...attributes,
  'aria-disabled': page.doing ? 'true' : null}, text);

function table(caption, heads, rows) {
  return el('table', {}, el('caption', {}, caption),
    el('thead', {}, el('tr', {}, heads.map((h) => el('th', {scope: 'col'}, h)))),
    el('tbody', {}, rows.map((row) => el('tr', {}, row.map((cell, k) =>
      (k === 0 ? el('th', {scope: 'row'}, cell) : el('td', {}, cell)))))));
}

/* --- candidates -------------------------------------------------------------------------- */

function makeCandidates(view, onAct) {
  let all = false;
  let step = 0;

  function draw() {
    const {candidates, validation_error_percent: now} = view.steps[step];
    const box = $('#candidates');
    if (!candidates.length) {
      box.replaceChildren(el('p', {class: 'none'}, 'No candidate was tried on this model.'), ...(view.actions ? [anyOther()] : []));
      return;
    }
    const passing = candidates.filter((c) => c.passes).length;
    const count = all ? candidates.length : Math.max(passing, Math.min(SHORT_LIST, candidates.length));
    const named = explains(view, step);
    let rank = 0;
    const rows = candidates.slice(0, count).map((c) => row(c, now, named && c.passes ? (rank += 1) : null));
    const heads = ['', 'effect and law', 'what is left', 'error on held-out data', 'ΔBIC', ...(view.actions ? [''] : [])];
    const head = el('thead', {}, el('tr', {}, heads.map((h, k) =>
      (h ? el('th', {scope: 'col'}, h) : el('th', {scope: 'col'}, el('span', {class: 'aside'}, k ? 'action' : 'rank'))))));
    const parts = [el('div', {class: 'scroll'}, el('table', {class: 'candidates'}, head, ...rows)),
      el('p', {class: 'aside-note'}, 'ΔBIC: how much the training data speak for it, less a price for each parameter; what counts begins at 20 or above.')];
    if (!passing) parts.unshift(el('p', {class: 'none'}, ...nothingPasses(view, view.steps[step])));
    else if (!named) parts.unshift(el('p', {class: 'none'}, 'None of these is enough to be named; the nearest come first.'));
    if (candidates.length > SHORT_LIST && passing < candidates.length) {
      parts.push(el('button', {type: 'button', class: 'more', 'data-hold': 'more', onclick: () => {
        all = !all;
        keepingFocus(draw);
      }}, all ? 'Show fewer' : `Show ${candidates.length - count} more`));
    }
    if (view.actions) parts.push(anyOther());
    box.replaceChildren(...parts);
  }

  /** Whatever the data say for it, any effect that the model has room for can be added. */
  function anyOther() {
    const {addable} = view.steps[step];
    if (!addable.length) return '';
    const choice = el('select', {'aria-label': 'Effect to add'}, view.effects.filter((e) => addable.includes(e.key))
      .map((e) => el('option', {value: e.key}, e.title)));
    return el('p', {class: 'other'}, 'any other: ', choice, ' ',
      actButton({'data-hold': 'add any other', onclick: () => onAct('add', choice.value)}, 'Add'));
  }

  /** One candidate: what it does to the error, and under it its law with the fitted numbers. */
  function row(c, now, rank) {
    const after = c.validation_error_percent;
    const change = now && after !== null ? (after - now) / now : null;
    const fitted = c.parameters.length > 0;
    const cells = [
      el('td', {class: 'rank', rowspan: 2}, rank === null ? '–' : String(rank)),
      el('th', {scope: 'row'}, el('span', {class: 'title'}, cap(c.title)), place(c)),
      el('td', {class: 'evidence'}, c.curve ? sparkline(c) : ''),
      el('td', {class: 'change'}, ...(fitted ? [changeText(now, after, change), changeBar(change, rank !== null)] : [el('span', {class: 'gain'}, 'not refitted')])),
      el('td', {class: 'bic'}, c.delta_bic === null ? '–' : signed(c.delta_bic)),
    ];
    if (view.actions) cells.push(el('td', {rowspan: 2}, c.added ? '' : actButton({class: rank === null ? 'act' : 'act primary',
      'aria-label': `Add ${c.title}`, 'data-hold': `add ${c.effect}`, onclick: () => onAct('add', c.effect)}, 'Add')));
    const law = [c.law && symbols(c.law), valuesText(c)].filter(Boolean).join('  ·  ');
    return el('tbody', {class: c.passes ? 'passes' : 'fails', 'data-effect': c.effect},
      el('tr', {}, cells), el('tr', {class: 'law'}, el('td', {colspan: 4}, notes(c, rank), law)));
  }

  const place = (c) => (c.equation && c.equation !== 'mechanical'
    ? el('span', {class: 'tag'}, c.equation) : null);

  function valuesText(c) {
    const largest = {};
    c.parameters.forEach((p) => {
      largest[p.unit] = Math.max(largest[p.unit] || 0, Math.abs(p.value), p.sigma || 0);
    });
    return c.parameters.map((p) => {
      const [factor, letter] = prefix(largest[p.unit], p.unit);
      const [value, sigma] = withSigma(p.value === null ? null : p.value * factor, p.sigma && p.sigma * factor);
      const unit = `${letter}${unitText(p.unit)}`;
      return `${symbols(p.name)} = ${value}${sigma ? ` ± ${sigma}` : ''}${unit ? ` ${unit}` : ''}`;
    }).join(', ');
  }

  function notes(c, rank) {
    const texts = [];
    if (c.note) texts.push(c.note);
    if (c.confusable_with.length) texts.push(`cannot be told from ${listed(c.confusable_with.map((e) => e.title))}`);
    return [c.added ? el('span', {class: rank === null ? 'note mild' : 'note ok'}, `added in ${c.added}`) : null,
      texts.length ? el('span', {class: c.passes ? 'note mild' : 'note'}, texts.join(' · ')) : null];
  }

  function changeText(now, after, change) {
    const gain = change === null ? '' : change < -5e-4 ? `${MINUS}${digits(-100 * change, 2)} %`
      : change > 5e-4 ? `+${digits(100 * change, 2)} %` : '±0 %';
    return el('span', {class: 'numbers'}, `${digits(now)} → `, el('b', {}, digits(after)), ' %',
      el('span', {class: 'gain'}, gain));
  }

  function changeBar(change, good) {
    const fill = el('i', {class: good ? 'fill good' : 'fill'});
    fill.style.width = `${(100 * Math.min(1, Math.max(0, -(change || 0)))).toFixed(1)}%`;
    return el('span', {class: 'track'}, fill);
  }

  return {show(index) {
    step = index;
    draw();
  }};
}

const signed = (value) => `${value < 0 ? MINUS : '+'}${Math.abs(value) < 10 ? Math.abs(value).toFixed(1)
  : Math.round(Math.abs(value)).toLocaleString('en').replace(/,/g, '\u202f')}`;

/** Evidence of a candidate: binned residual as dots, its law as a line. */
function sparkline(candidate) {
  const {curve} = candidate;
  const [x, mean, law] = [curve.x, curve.mean, curve.law].map(f32);
  const [width, height] = [92, 34];
  const used = finite(x);
  const [x0, x1] = [Math.min(...used), Math.max(...used)];
  const reach = Math.max(...finite(mean).map(Math.abs), ...finite(law).map(Math.abs), 1e-12) * 1.1;
  const frame = {atX: (v) => 2 + ((v - x0) / (x1 - x0 || 1)) * (width - 4), atY: (v) => (height / 2) * (1 - v / reach)};
  const dots = Array.from(x.keys()).filter((k) => Number.isFinite(mean[k])).map((k) =>
    svg('circle', {cx: frame.atX(x[k]).toFixed(1), cy: frame.atY(mean[k]).toFixed(1), r: 1.2}));
  return svg('svg', {width, height, viewBox: `0 0 ${width} ${height}`, class: 'spark', role: 'img',
    'aria-label': `${curve.quantity} by ${curve.axis} and the law of ${candidate.title}`},
  svg('line', {x1: 0, x2: width, y1: height / 2, y2: height / 2, class: 'zero'}), ...dots,
  svg('path', {class: 'law', d: pathOf(x, law, frame)}));
}

/* --- models ------------------------------------------------------------------------------ */

function drawModels(view, step, onPick, onAct) {
  const outputs = Object.keys(view.steps[0].channel_errors);
  const heads = ['model', 'effects', 'held out', '× floor', ...(outputs.length > 1 ? outputs : []), 'training', 'parameters'];
  const onRow = (k) => (event) => {
    if (!event.target.closest('button.act')) onPick(k);
  };
  const rows = view.steps.map((s, k) => el('tr', {class: k === step ? 'current' : '', onclick: onRow(k)},
    el('th', {scope: 'row'}, el('button', {type: 'button', class: 'link', 'aria-pressed': String(k === step),
      'data-hold': `model ${k}`}, s.name)),
    el('td', {class: 'text'}, effectsText(view, s), view.actions && k === step
      ? s.effects.map((e) => actButton({'aria-label': `Remove ${e.title}`, 'data-hold': `remove ${e.key}`,
        onclick: () => onAct('remove', e.key)}, `Remove ${e.title}`)) : null),
    el('td', {}, digits(s.validation_error_percent)),
    el('td', {}, times(s.times_floor)),
    ...(outputs.length > 1 ? outputs.map((o) => el('td', {}, digits(s.channel_errors[o]))) : []),
    el('td', {}, digits(s.train_error_percent)),
    el('td', {}, String(s.parameters.filter((p) => p.free).length))));
  $('#model-table').replaceChildren(
    el('thead', {}, el('tr', {}, heads.map((h) =>
      el('th', {scope: 'col', class: h === 'effects' ? 'text' : ''}, h.replace(/_/g, ' '))))),
    el('tbody', {}, rows));
}

const effectsText = (view, step) =>
  [view.motor.title, ...step.effects.map((e) => e.title)].join(' + ');

/* --- parameters -------------------------------------------------------------------------- */

function drawParameters(view, step) {
  const {name, parameters} = view.steps[step];
  $('#parameters-of').textContent = name;
  const heads = ['symbol', 'meaning', 'value', '± 1σ', 'unit', step ? 'change from M0' : ''];
  const fitted = parameters.filter((p) => p.free);
  const fixed = parameters.filter((p) => !p.free);
  $('#parameter-table').replaceChildren(
    el('thead', {}, el('tr', {}, heads.filter(Boolean).map((h, k) =>
      el('th', {scope: 'col', class: k === 1 || k > 3 ? 'text' : ''}, h)))),
    el('tbody', {}, fitted.map((p) => parameterRow(p, step))));
  const constants = fixed.map((p) => `${symbols(p.name)} = ${digits(p.value, 4)} ${unitText(p.unit)}`.trim());
  $('#constants').textContent = fixed.length ? `Not fitted: ${constants.join(', ')}.` : '';
}

function parameterRow(p, step) {
  const [value, sigma] = withSigma(p.value, p.sigma);
  const spread = p.known ? sigma : 'unknown';
  const meaning = cap(p.effect ? `${p.effect}: ${p.description}` : p.description);
  return el('tr', {},
    el('th', {scope: 'row'}, symbols(p.name)),
    el('td', {class: 'text'}, meaning, p.on_bound ? el('span', {class: 'note'}, ' at its bound') : null,
      p.known ? null : el('span', {class: 'note'}, ' these data do not determine it')),
    el('td', {}, value), el('td', {}, spread), el('td', {class: 'text'}, unitText(p.unit)),
    step ? el('td', {class: 'text'}, baseText(p)) : null);
}

/** How wrong the value was in M0, in words. */
function baseText(p) {
  if (p.base === null) return p.effect ? el('b', {class: 'ok'}, 'new') : '';
  if (!p.known || Math.abs(p.value) <= 3 * (p.sigma || 0)) return p.base === p.value ? '' : `M0: ${digits(p.base)}`;
  const ratio = p.base / p.value;
  const off = Math.abs(ratio - 1);
  if (off < 2e-3) return 'as in M0';
  if (ratio < 0) return el('b', {class: 'bad'}, 'M0 had the wrong sign');
  const size = ratio >= 1.5 ? `${digits(ratio, 2)}×` : ratio <= 0.667 ? `${digits(1 / ratio, 2)}×` : `${digits(100 * off, 2)} %`;
  const text = `M0 was ${size} too ${ratio > 1 ? 'large' : 'small'}`;
  return off > 0.1 ? el('b', {class: 'bad'}, text) : text;
}
