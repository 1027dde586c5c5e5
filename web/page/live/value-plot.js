// Lines of the value plot: each goal in its colour, as in the scene; the chosen one is thicker;
// a dashed line marks a target switch.
import { html, render } from "../vendor/htm-preact-standalone.module.js";

const LABEL_GAP = 13;
const THIN = 1.6;
const THICK = 3.4;

/**
 * Least value that sets the scale. A value below it means that a contact is expected: its line
 * leaves the plot, so that a person who touches the arm does not flatten all other lines.
 */
const LEAST_SHOWN = -5;

/** Ends of the value axis that shows values from `low` to `high`. */
export function valueRange(low, high) {
  return [Math.max(low, Math.min(LEAST_SHOWN, high - 1)), high];
}

/**
 * Draw hook of uPlot. The history may be newer than the plot's data, so the ids are those of the
 * plot's series, and what is chosen may have no column yet.
 */
export function drawValues(plot, { history, labelOf, colourOf }, theme) {
  const { ctx, bbox } = plot;
  const dpr = devicePixelRatio;
  const ids = plot.series.slice(1).map((one) => one.label);
  const chosen = history.chosen();
  const switches = history.switches().filter(({ i }) => ids.includes(chosen[i]));
  const [x, ...columns] = plot.data;
  if (x.length !== chosen.length) return;
  const at = (i, column) => [plot.valToPos(x[i], "x", true), plot.valToPos(column[i], "y", true)];
  ctx.save();
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  markSwitches(ctx, bbox, switches, (i) => plot.valToPos(x[i], "x", true), theme, dpr);
  ctx.lineJoin = ctx.lineCap = "round";
  for (const isThick of [false, true]) {
    ctx.lineWidth = (isThick ? THICK : THIN) * dpr;
    columns.forEach((column, k) => {
      const wanted = (i) => (chosen[i] === ids[k]) === isThick;
      ctx.strokeStyle = colourOf(ids[k]);
      drawPieces(ctx, column, at, wanted);
    });
  }
  markChoices(ctx, switches, (i) => at(i, columns[ids.indexOf(chosen[i])]), theme, dpr);
  ctx.restore();
  ctx.restore();
  label(plot, ids, columns, chosen.findLast((one) => one), labelOf);
}

/** Stroke the pieces that `wanted` accepts. */
function drawPieces(ctx, column, at, wanted) {
  ctx.beginPath();
  let drawn = false;
  for (let i = 1; i < column.length; i++) {
    const before = drawn;
    drawn = wanted(i) && Number.isFinite(column[i]) && Number.isFinite(column[i - 1]);
    if (drawn && !before) ctx.moveTo(...at(i - 1, column));
    if (drawn) ctx.lineTo(...at(i, column));
  }
  ctx.stroke();
}

/** A dashed line at a switch away from a goal that was still a candidate. */
function markSwitches(ctx, bbox, switches, xAt, theme, dpr) {
  ctx.strokeStyle = theme.faint;
  ctx.lineWidth = dpr;
  ctx.setLineDash([2 * dpr, 3 * dpr]);
  for (const { i, open } of switches) {
    if (!open) continue;
    ctx.beginPath();
    ctx.moveTo(xAt(i), bbox.top);
    ctx.lineTo(xAt(i), bbox.top + bbox.height);
    ctx.stroke();
  }
  ctx.setLineDash([]);
}

/** A ring at the start of a new choice. */
function markChoices(ctx, switches, at, theme, dpr) {
  ctx.fillStyle = theme.panel;
  ctx.strokeStyle = theme.ink;
  ctx.lineWidth = 1.6 * dpr;
  for (const { i } of switches) {
    const [x, y] = at(i);
    if (!Number.isFinite(y)) continue;
    ctx.beginPath();
    ctx.arc(x, y, 3.6 * dpr, 0, 7);
    ctx.fill();
    ctx.stroke();
  }
}

/** Names at the right ends of the lines, pushed apart where they would overlap. */
function label(plot, ids, columns, chosen, labelOf) {
  const { offsetLeft, offsetTop, clientWidth, clientHeight } = plot.over;
  const last = columns[0]?.findLastIndex((_, i) => columns.some((one) => Number.isFinite(one[i])));
  const ends = ids
    .map((id, k) => ({ id, value: columns[k][last] }))
    .filter((end) => Number.isFinite(end.value))
    .map((end) => ({ ...end, name: labelOf(end.id), y: plot.valToPos(end.value, "y") }))
    .sort((a, b) => a.y - b.y);
  ends.forEach((end, i) => {
    if (i) end.y = Math.max(end.y, ends[i - 1].y + LABEL_GAP);
  });
  for (let i = ends.length - 1, floor = clientHeight; i >= 0 && ends[i].y > floor; i--) {
    ends[i].y = floor;
    floor -= LABEL_GAP;
  }
  const box = plot.root.querySelector(".line-names")
    ?? plot.root.firstChild.appendChild(document.createElement("div"));
  box.className = "line-names";
  box.style.left = `${offsetLeft + clientWidth + 8}px`;
  render(ends.map(({ id, name, y }) => html`<span key=${id} title=${name}
    class=${id === chosen ? "is-chosen" : ""} style=${{ top: `${offsetTop + y}px` }}>${name}</span>`), box);
}
