'use strict';
/* The strip over the traces: which stretch was fitted or held out, and the regime of each moment. */

const STRIP_HEIGHT = 30;

/** Draw the strip for a range of time; it lines up with the panels below it. */
function strip(view, {time, regimes, endOf, range, stretchName, width}) {
  const canvas = $('#strip');
  const scale = devicePixelRatio || 1;
  canvas.width = width * scale;
  canvas.height = STRIP_HEIGHT * scale;
  canvas.style.width = `${width}px`;
  const ctx = canvas.getContext('2d');
  ctx.scale(scale, scale);
  const inner = width - AXIS_WIDTH - RIGHT_GAP;
  const x = (t) => AXIS_WIDTH + ((t - range[0]) / (range[1] - range[0])) * inner;
  ctx.beginPath();
  ctx.rect(AXIS_WIDTH, 0, inner, STRIP_HEIGHT);
  ctx.clip();
  view.records.forEach((record) => stretch(ctx, record, stretchName(record), x, AXIS_WIDTH + inner));
  if (!regimes) return;
  for (let k = 0; k + 1 < time.length; k += 1) {
    if (time[k + 1] < range[0] || time[k] > range[1] || regimes.ids[k] > 3) continue;
    let last = k;
    while (last + 2 < time.length && regimes.ids[last + 1] === regimes.ids[k]) last += 1;
    ctx.fillStyle = palette[`regime-${regimes.ids[k]}`];
    ctx.fillRect(x(time[k]), 18, Math.max(0.7, x(endOf(last)) - x(time[k])), 12);
    k = last;
  }
}

function stretch(ctx, record, name, x, right) {
  const [a, b] = [Math.max(AXIS_WIDTH, x(record.start)), Math.min(right, x(record.end))];
  if (b <= a) return;
  const held = record.role !== 'train';
  ctx.fillStyle = held ? palette.model : palette.measured;
  ctx.fillRect(a, 13, b - a - 1, 2);
  ctx.fillStyle = palette[held ? 'model' : 'muted'];
  ctx.font = '11px system-ui, sans-serif';
  if (ctx.measureText(name).width < b - a - 4) ctx.fillText(name, a + 2, 10);
}
