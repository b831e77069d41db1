'use strict';
/* What is not the same in all records: a point with its interval for each of them. */

const DIFFERENCE_ROW = 22;
const NAME_SPACE = 120;
const VALUE_SPACE = 92;

function drawDifferences(view) {
  const found = view.verdict.differences ?? [];
  const box = $('#differences');
  box.hidden = !found.length;
  box.replaceChildren(...found.map((one) => differenceFigure(one, Math.max(300, box.clientWidth))));
}

function differenceFigure(one, width) {
  const left = one.values.some((v) => !v.searched && v.value !== null);
  return el('figure', {},
    el('figcaption', {}, el('b', {}, `${cap(one.description)} `), one.name === 'input' ? '' : `${symbols(one.name)} `,
      `is not the same in all records${left ? ' (hollow: left out of the search)' : ''}`),
    differencePicture(one, width));
}

function differencePicture(one, width) {
  const rows = one.values.filter((v) => v.value !== null);
  const ends = rows.flatMap((v) => [v.low, v.high]);
  const [low, high] = padded(Math.min(...ends), Math.max(...ends));
  const atX = (v) => NAME_SPACE + ((v - low) / (high - low)) * (width - NAME_SPACE - VALUE_SPACE);
  const [factor, letter] = prefix(Math.max(...rows.map((v) => Math.abs(v.value))), one.unit);
  const said = (v) => `${digits(v.value * factor)} ${letter}${unitText(one.unit)}`.trim();
  const height = DIFFERENCE_ROW * rows.length + 4;
  const first = atX(rows[0].value);
  const parts = [svg('line', {x1: first, x2: first, y1: 2, y2: height - 2, class: 'zero'})];
  rows.forEach((v, k) => {
    const y = DIFFERENCE_ROW * (k + 0.5) + 2;
    parts.push(
      svg('text', {x: 0, y: y + 4, class: 'tick'}, fitting(v.record)),
      svg('line', {x1: atX(v.low), x2: atX(v.high), y1: y, y2: y, class: 'whisker'}),
      svg('circle', {cx: atX(v.value), cy: y, r: 4, class: v.searched ? 'dot' : 'dot hollow'}),
      svg('text', {x: width, y: y + 4, 'text-anchor': 'end', class: 'tick'}, said(v)));
  });
  const label = `${cap(one.description)}: ${listed(rows.map((v) => `${said(v)} in ${v.record}`))}.`;
  return svg('svg', {width, height, role: 'img', 'aria-label': label}, ...parts);
}

const NAME_LETTERS = 18;
const FOLDER_LETTERS = 8;

/** A text without its middle, so that it has no more letters than that. */
function squeezed(text, most) {
  const head = Math.floor((most - 1) / 2);
  return text.length > most ? `${text.slice(0, head)}…${text.slice(1 + head - most)}` : text;
}

/** A name that fits: names differ in their folder or at either end. */
function fitting(name) {
  const [folder, ...rest] = name.split('/');
  if (!rest.length || name.length <= NAME_LETTERS) return squeezed(name, NAME_LETTERS);
  const file = rest.join('/');
  const first = squeezed(folder, Math.max(FOLDER_LETTERS, NAME_LETTERS - 1 - file.length));
  return `${first}/${squeezed(file, NAME_LETTERS - 1 - first.length)}`;
}
