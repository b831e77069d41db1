'use strict';
/* What the catalogue does not know: the axis on which it lives, with its shape. */

const AXES_SHOWN = 5;

function drawUnknown(view) {
  const box = $('#lives');
  const found = view.verdict.unknown.filter((u, k) => u.axis || k === 0);
  box.hidden = !found.length;
  const draw = () => box.replaceChildren(...found.map(unknownFigure));
  draw();
  found.forEach((one, k) => {
    const holder = $$('.curve', box)[k];
    if (one.curve && holder) holder.replaceChildren(lawOf(one, Math.max(180, holder.clientWidth)));
  });
}

const $$ = (selector, root = document) => Array.from(root.querySelectorAll(selector));

function unknownFigure(one) {
  const shares = [...one.axes].sort((a, b) => b.best - a.best || (b.share || 0) - (a.share || 0)).slice(0, AXES_SHOWN);
  return el('figure', {},
    el('p', {class: 'none'}, symbols(one.words)),
    el('div', {class: 'pair'}, el('div', {class: 'curve'}),
      el('div', {role: 'group', 'aria-label': `Share of the ${one.quantity} that each axis explains`},
        ...shares.map(axisRow))));
}

function axisRow(a) {
  const fill = el('i', {class: 'fill'});
  fill.style.width = `${Math.round(100 * (a.share || 0))}%`;
  return el('div', {class: a.best ? 'axis-share best' : 'axis-share'}, el('span', {}, a.axis), fill,
    el('span', {}, share(a.share)));
}

function lawOf(one, width) {
  return curvePicture({...one.curve, name: one.shape}, width, reachOf(one.curve) || 1);
}

function drawBlindSpots(view) {
  const spots = view.verdict.blind_spots;
  $('#blind').hidden = !spots.length;
  $('#blind summary').textContent = `What these data cannot show (${spots.length})`;
  $('#blind ul').replaceChildren(...spots.map((s) => el('li', {}, `${symbols(s.words)} ${cap(s.remedy)}.`)));
}
