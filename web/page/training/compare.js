// Comparison of jobs: one curve per group of seeds with its band, and the fields that differ.
import { html, useEffect, useMemo, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { Alert, Close } from "../icons.js";
import { GOALS } from "../palette.js";
import { FEW, Plot, stepOptions, useTheme } from "../plots.js";
import { FieldName, fieldOf, fieldValue, presetTitle } from "./fieldnames.js";
import { useAnswer } from "./formfields.js";

export const MAX_JOBS = 20;
const RATES = new Set(["success", "collision", "timeout"]);
const QUANTITIES = { success: "success [%]", collision: "collision [%]", timeout: "timeout [%]",
  reward: "mean reward of an episode", cpu_s: "CPU time [s]", time_left_s: "time left [s]",
  updates_per_s: "updates per s", steps_per_s: "steps per s" };
const NAMED = 3; // fields that the name of a group lists
const HEIGHT = 300;
const PATTERN = [8, 4]; // line and gap of groups whose colour an earlier one has [px]

const quantityName = (name) => QUANTITIES[name] ?? name.replaceAll("_", " ");

/** A dialog over the page; `ids` are the compared jobs, in their order. */
export function Comparison({ ids, presets, onClose }) {
  const [quantity, setQuantity] = useState(null);
  const dialog = useRef(null);
  const query = ids.map((id) => `job=${encodeURIComponent(id)}`).join("&");
  const chosen = quantity ? `&quantity=${encodeURIComponent(quantity)}` : "";
  const { answer, error } = useAnswer(`v1/comparison?${query}${chosen}`);
  const found = useMemo(() => answer && { ...answer, groups: labelled(answer, presets) }, [answer, presets.items]);
  useEffect(() => dialog.current.showModal(), []);
  return html`<dialog class="compare" ref=${dialog} onClose=${onClose} data-role="comparison"
    aria-labelledby="compare-title">
    <header class="card-head"><h2 id="compare-title">Comparison of ${format.count(ids.length, "job")}</h2>
      <${Close} label="Close the comparison" onClick=${() => dialog.current.close()} /></header>
    ${error && html`<${Alert}>${format.sentence(error.message)} Close the comparison and open it
      again.</${Alert}>`}
    ${!found && !error && html`<div class="skeleton tall" aria-busy="true"
      aria-label="Loading the curves"></div>`}
    ${found && html`
      <${Curves} found=${found} query=${query} dialog=${dialog} onQuantity=${setQuantity} />
      <${Differences} found=${found} presets=${presets} />`}
  </dialog>`;
}

function Curves({ found, query, dialog, onQuantity }) {
  const [at, setAt] = useState(null);
  if (found.steps.length === 0) {
    return html`<p class="empty">These jobs have no points of a learning curve: choose
      trainings that have reached their first point.</p>`;
  }
  return html`
    <div class="compare-tools">
      <label>Quantity <select data-role="quantity" value=${found.quantity}
        onChange=${(e) => onQuantity(e.target.value)}>
        ${found.quantities.map((name) => html`<option key=${name} value=${name}>
          ${quantityName(name)}</option>`)}</select></label>
      <span class="spacer"></span>
      <a class="tool" download="jobs.csv" title="Download all points of the curves"
        href=${`v1/comparison/csv?${query}`}>CSV</a>
      <button type="button" class="tool" data-action="png" title="Download the plot"
        onClick=${() => savePicture(dialog.current, found)}>PNG</button>
    </div>
    <${GroupPlot} found=${found} onHover=${setAt} />
    <p class="plot-foot"><span>Environment steps</span>
      <span>${!Number.isInteger(at)
      ? "last point of each curve" : format.count(found.steps[at], "step")}</span></p>
    <ul class="groups" data-role="groups">${found.groups.map((group, i) => html`
      <li key=${group.jobs[0]}><i class="line-mark" style=${{ background: markOf(i) }}></i>
        <b>${group.label}</b> <span>${seedsOf(group, found)}</span>
        <span class="readout">${readout(group, at ?? lastOf(group), found.quantity)}</span></li>`)}</ul>
    <p class="field-help">Line: mean over the seeds. Band: from the least to the greatest
      of them.</p>`;
}

function seedsOf(group, found) {
  const seeds = found.jobs.filter((job) => group.jobs.includes(job.id)).map((job) => job.seed);
  return seeds.length === 1 ? `seed ${seeds[0]}` : `seeds ${seeds.join(", ")}`;
}

/** Place of the last point of a group's curve. */
function lastOf({ mean }) {
  return mean.findLastIndex((v) => v !== null);
}

function readout(group, place, quantity) {
  const [mean, low, high] = [group.mean, group.low, group.high].map((row) => row[place]);
  if (!Number.isFinite(mean)) return "–";
  const show = shower(quantity);
  return group.n[place] > 1 ? `${show(mean)} (${show(low)} to ${show(high)})` : show(mean);
}

function shower(quantity) {
  return RATES.has(quantity) ? (v) => format.percent(v) : (v) => format.number(v);
}

function colour(i, alpha = 1) {
  return GOALS[i % GOALS.length].replace(")", ` / ${alpha})`);
}

/** Lengths of line and gap of a group whose colour an earlier one has; [] for an unbroken line. */
function patternOf(i) {
  return i < GOALS.length ? [] : PATTERN;
}

/** The background of a group's mark in the legend. */
function markOf(i) {
  const [line, gap] = patternOf(i);
  return line ? `repeating-linear-gradient(90deg, ${colour(i)} 0 ${line / 2}px, transparent 0 ${
    (line + gap) / 2}px)` : colour(i);
}

function GroupPlot({ found, onHover }) {
  const theme = useTheme();
  const hover = useRef(onHover);
  hover.current = onHover;
  const options = useMemo(() => groupOptions(theme, found, hover), [theme, found]);
  const data = useMemo(
    () => [found.steps, ...found.groups.flatMap((g) => [g.mean, g.high, g.low])], [found]);
  return html`<${Plot} options=${options} data=${data} height=${HEIGHT}
    label=${`${quantityName(found.quantity)} over environment steps of ${format.count(found.groups.length, "group")} of jobs`} />`;
}

function groupOptions(theme, { groups, quantity }, hover) {
  const rate = RATES.has(quantity);
  const edge = { points: { show: false }, width: 0, spanGaps: true };
  return stepOptions(theme, hover, {
    y: rate ? { range: [0, 1] } : {}, size: 52, unit: rate ? "%" : "",
    series: [{}, ...groups.flatMap((group, i) => [
      { stroke: colour(i), width: 2, dash: patternOf(i), spanGaps: true, points: FEW }, edge, edge,
    ])],
    bands: groups.map((_, i) => ({ series: [3 * i + 2, 3 * i + 3], fill: colour(i, 0.16) })),
  });
}

/** The fields that differ: a column for each job. */
function Differences({ found, presets }) {
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
        <th scope="row"><${FieldName} presets=${presets} path=${field}
          preset=${jobs.find((job) => job.preset)?.preset} named /></th>
        ${values.map((v, i) => html`<td key=${jobs[i].id}>${
          field === "preset" ? presetTitle(presets, v) : fieldValue(v)}</td>`)}</tr>`)}</tbody>
    </table></div>`;
}

/** The groups with their labels; groups of the same label have the numbers of their jobs, too. */
function labelled(answer, presets) {
  const labels = answer.groups.map((group) => labelOf(group, answer, presets));
  return answer.groups.map((group, i) => {
    if (labels.indexOf(labels[i]) === labels.lastIndexOf(labels[i])) return { ...group, label: labels[i] };
    const numbers = answer.jobs.filter(({ id }) => group.jobs.includes(id)).map((job) => job.number);
    return { ...group, label: `${labels[i]} (job ${numbers.join(", ")})` };
  });
}

/** A group's values of the fields that differ between the trainings; the preset if none does. */
function labelOf(group, { jobs, groups, differences }, presets) {
  const place = jobs.findIndex(({ id }) => id === group.jobs[0]);
  const trained = groups.map(({ jobs: [id] }) => jobs.findIndex((job) => job.id === id));
  const differ = differences.filter(({ field, values }) => field !== "seed"
    && trained.some((i) => JSON.stringify(values[i]) !== JSON.stringify(values[place])));
  const { preset } = jobs[place];
  if (differ.length === 0 || differ.some(({ field }) => field === "preset")) {
    return presetTitle(presets, preset);
  }
  const parts = differ.slice(0, NAMED).map(({ field, values }) =>
    `${fieldOf(presets, field, preset).title} = ${fieldValue(values[place])}`);
  const more = differ.length > NAMED ? `, ${differ.length - NAMED} more` : "";
  return parts.join(", ") + more;
}

/** Save the plot with its title and legend as a PNG file, as wide as the longest of their lines. */
function savePicture(dialog, found) {
  const plot = dialog.querySelector(".plot canvas");
  const style = getComputedStyle(dialog);
  const scale = plot.width / plot.clientWidth;
  const [line, margin, top, indent] = [20, 16, 40, 26].map((v) => v * scale);
  const picture = document.createElement("canvas");
  const pen = picture.getContext("2d");
  const fontOf = (weight) => `${weight} ${13 * scale}px Inter, system-ui, sans-serif`;
  const title = `${format.capital(quantityName(found.quantity))} over environment steps`;
  const texts = found.groups.map((group) => `${group.label} · ${seedsOf(group, found)} · last ${
    readout(group, lastOf(group), found.quantity)}`);
  pen.font = fontOf(600);
  const widths = [plot.width, pen.measureText(title).width];
  pen.font = fontOf(400);
  widths.push(...texts.map((text) => indent + pen.measureText(text).width));
  picture.width = Math.ceil(Math.max(...widths)) + 2 * margin;
  picture.height = top + plot.height + line * (texts.length + 2) + margin;
  pen.fillStyle = style.backgroundColor;
  pen.fillRect(0, 0, picture.width, picture.height);
  pen.fillStyle = style.color;
  pen.font = fontOf(600);
  pen.fillText(title, margin, 26 * scale);
  pen.drawImage(plot, margin, top);
  pen.font = fontOf(400);
  texts.forEach((text, i) => {
    const y = top + plot.height + line * (i + 1.5);
    pen.strokeStyle = colour(i);
    pen.lineWidth = 3 * scale;
    pen.setLineDash(patternOf(i).map((v) => (v / 2) * scale));
    pen.beginPath();
    pen.moveTo(margin, y - 4.5 * scale);
    pen.lineTo(margin + 16 * scale, y - 4.5 * scale);
    pen.stroke();
    pen.fillText(text, margin + indent, y);
  });
  picture.toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = "jobs.png";
    link.click();
    URL.revokeObjectURL(link.href);
  });
}
