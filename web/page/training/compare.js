// Comparison of jobs: one curve per group of seeds with its band, and the fields that differ.
import { html, useEffect, useMemo, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { Alert, Icon } from "../icons.js";
import { GOALS } from "../palette.js";
import { axis, Plot, useTheme } from "../plots.js";
import { useAnswer } from "./formfields.js";

export const MAX_JOBS = 20;
const RATES = new Set(["success", "collision", "timeout"]);
const HEIGHT = 300;

/** A dialog over the page; `ids` are the compared jobs, in their order. */
export function Comparison({ ids, onClose }) {
  const [quantity, setQuantity] = useState(null);
  const dialog = useRef(null);
  const query = ids.map((id) => `job=${encodeURIComponent(id)}`).join("&");
  const chosen = quantity ? `&quantity=${encodeURIComponent(quantity)}` : "";
  const { answer: found, error } = useAnswer(`v1/comparison?${query}${chosen}`);
  useEffect(() => dialog.current.showModal(), []);
  return html`<dialog class="compare" ref=${dialog} onClose=${onClose} data-role="comparison"
    aria-labelledby="compare-title">
    <header class="card-head"><h2 id="compare-title">Comparison of ${ids.length} ${ids.length === 1 ? "job" : "jobs"}</h2>
      <button type="button" class="quiet-button" aria-label="Close the comparison"
        onClick=${() => dialog.current.close()}><${Icon} name="close" /></button></header>
    ${error && html`<${Alert}>${error.message}</${Alert}>`}
    ${!found && !error && html`<div class="skeleton tall" aria-busy="true"
      aria-label="Loading the curves"></div>`}
    ${found && html`
      <${Curves} found=${found} query=${query} dialog=${dialog} onQuantity=${setQuantity} />
      <${Differences} found=${found} />`}
  </dialog>`;
}

function Curves({ found, query, dialog, onQuantity }) {
  const [at, setAt] = useState(null);
  if (found.steps.length === 0) {
    return html`<p class="empty">These jobs have no points of a learning curve yet.</p>`;
  }
  const place = at ?? found.steps.length - 1;
  return html`
    <div class="compare-tools">
      <label>Quantity <select data-role="quantity" value=${found.quantity}
        onChange=${(e) => onQuantity(e.target.value)}>
        ${found.quantities.map((name) => html`<option key=${name} value=${name}>
          ${name.replaceAll("_", " ")}</option>`)}</select></label>
      <span class="spacer"></span>
      <a class="tool" download="jobs.csv" href=${`v1/comparison/csv?${query}`}>CSV</a>
      <button type="button" class="tool" data-action="png"
        onClick=${() => savePicture(dialog.current, found)}>PNG</button>
    </div>
    <${GroupPlot} found=${found} onHover=${setAt} />
    <p class="plot-foot"><span>Environment steps</span>
      <span>${format.steps(found.steps[place])} steps</span></p>
    <ul class="groups" data-role="groups">${found.groups.map((group, i) => html`
      <li key=${group.label}><i class="line-mark" style=${{ background: colour(i) }}></i>
        <b>${group.label}</b> <span>${seedsOf(group, found)}</span>
        <span class="readout">${readout(group, place, found.quantity)}</span></li>`)}</ul>
    <p class="field-help">Line: mean over the seeds. Band: from the least to the greatest
      of them.</p>`;
}

function seedsOf(group, found) {
  const seeds = found.jobs.filter((job) => group.jobs.includes(job.id)).map((job) => job.seed);
  return seeds.length === 1 ? `seed ${seeds[0]}` : `seeds ${seeds.join(", ")}`;
}

function readout(group, place, quantity) {
  const [mean, low, high] = [group.mean, group.low, group.high].map((row) => row[place]);
  if (mean === null) return "–";
  const show = shower(quantity);
  return group.n[place] > 1 ? `${show(mean)} (${show(low)} to ${show(high)})` : show(mean);
}

function shower(quantity) {
  return RATES.has(quantity) ? (v) => format.percent(v) : (v) => format.number(v);
}

function colour(i, alpha = 1) {
  return GOALS[i % GOALS.length].replace(")", ` / ${alpha})`);
}

function GroupPlot({ found, onHover }) {
  const theme = useTheme();
  const hover = useRef(onHover);
  hover.current = onHover;
  const options = useMemo(() => groupOptions(theme, found, hover), [theme, found]);
  const data = useMemo(
    () => [found.steps, ...found.groups.flatMap((g) => [g.mean, g.high, g.low])], [found]);
  return html`<${Plot} options=${options} data=${data} height=${HEIGHT}
    label=${`${found.quantity} over environment steps of ${found.groups.length} groups of jobs`} />`;
}

function groupOptions(theme, { groups, quantity }, hover) {
  const rate = RATES.has(quantity);
  const show = rate ? (v) => `${Math.round(v * 100)} %` : (v) => format.number(v);
  const edge = { points: { show: false }, width: 0, spanGaps: true };
  return {
    legend: { show: false },
    padding: [8, 16, 0, 0],
    cursor: { y: false, drag: { setScale: false, x: false, y: false }, points: { size: 5 } },
    scales: {
      x: { time: false, range: (_, low, high) => [Math.min(0, low ?? 0), Math.max(high ?? 1, 1)] },
      y: rate ? { range: [0, 1] } : {},
    },
    axes: [
      axis(theme, { size: 24, space: 64, values: (_, t) => t.map((v) => (v ? format.steps(v) : "0")) }),
      axis(theme, { size: 52, space: 30, values: (_, t) => t.map(show) }),
    ],
    series: [{}, ...groups.flatMap((group, i) => [
      { stroke: colour(i), width: 2, spanGaps: true,
        points: { show: (plot) => plot.data[0].length < 3, size: 5 } },
      edge, edge,
    ])],
    bands: groups.map((_, i) => ({ series: [3 * i + 2, 3 * i + 3], fill: colour(i, 0.16) })),
    hooks: { setCursor: [(plot) => hover.current(plot.cursor.idx)] },
  };
}

/** The fields that differ: a column for each job. */
function Differences({ found }) {
  const { differences, jobs } = found;
  if (jobs.length < 2) return null;
  if (differences.length === 0) {
    return html`<p class="empty">These jobs have the same values in all fields.</p>`;
  }
  return html`<h3>Fields that differ</h3>
    <div class="scrolled"><table data-role="differences">
      <thead><tr><th scope="col">Field</th>${jobs.map((job) => html`<th key=${job.id} scope="col"
        title=${job.name ?? ""}>Job ${job.number}</th>`)}</tr></thead>
      <tbody>${differences.map(({ field, values }) => html`<tr key=${field}>
        <th scope="row">${field}</th>
        ${values.map((v, i) => html`<td key=${jobs[i].id}>${shown(v)}</td>`)}</tr>`)}</tbody>
    </table></div>`;
}

function shown(v) {
  if (v === null || v === undefined) return "–";
  return typeof v === "number" ? format.number(v, 6) : typeof v === "string" ? v : JSON.stringify(v);
}

/** Save the plot with its title and legend as a PNG file. */
function savePicture(dialog, found) {
  const plot = dialog.querySelector(".plot canvas");
  const style = getComputedStyle(dialog);
  const scale = plot.width / plot.clientWidth;
  const [line, margin, top] = [20, 16, 40].map((v) => v * scale);
  const picture = document.createElement("canvas");
  picture.width = plot.width + 2 * margin;
  picture.height = top + plot.height + line * (found.groups.length + 2) + margin;
  const pen = picture.getContext("2d");
  pen.fillStyle = style.backgroundColor;
  pen.fillRect(0, 0, picture.width, picture.height);
  const write = (text, x, y, weight = 400) => {
    pen.fillStyle = style.color;
    pen.font = `${weight} ${13 * scale}px Inter, system-ui, sans-serif`;
    pen.fillText(text, x, y);
  };
  write(`${found.quantity.replaceAll("_", " ")} over environment steps`, margin, 26 * scale, 600);
  pen.drawImage(plot, margin, top);
  found.groups.forEach((group, i) => {
    const y = top + plot.height + line * (i + 1.5);
    pen.fillStyle = colour(i);
    pen.fillRect(margin, y - 6 * scale, 16 * scale, 3 * scale);
    const last = readout(group, found.steps.length - 1, found.quantity);
    write(`${group.label} · ${seedsOf(group, found)} · last ${last}`, margin + 26 * scale, y);
  });
  picture.toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = "jobs.png";
    link.click();
    URL.revokeObjectURL(link.href);
  });
}
