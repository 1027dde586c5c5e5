// A sweep: its trials as a table and a plot, the best one marked.
import { html, useMemo } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { axis, Plot, useTheme } from "../plots.js";
import { FieldName, fieldValue } from "./fieldnames.js";
import { useAnswer } from "./formfields.js";
import { isActive, JobFrame } from "./jobactions.js";

const LABELS = { success: "success", collision: "collision", timeout: "timeout" };

export function SweepDetail({ job, presets, ...rest }) {
  // Asked for again whenever the list of jobs was.
  const { answer: found, error } = useAnswer(`v1/jobs/${job.id}/trials`, isActive(job) ? job : job.state);
  const trials = found?.items ?? [];
  return html`<${JobFrame} job=${job} error=${error} ...${rest}>
    ${!found && !error && html`<div class="skeleton tall" aria-busy="true" aria-label="Loading the trials"></div>`}
    ${found && trials.length === 0 && html`<p class="empty">${isActive(job)
      ? "The first trial is drawn in a moment." : "It ended before its first trial: resume or retry it."}</p>`}
    ${trials.some((one) => one.value) && html`<${TrialPlot} found=${found} />
      <p class="plot-foot"><span>${format.capital(LABELS[found.quantity])} [%] by trial, with 95 % intervals</span>
        <span>Line: best so far</span></p>`}
    ${trials.length > 0 && html`<${TrialTable} found=${found}
      presets=${presets} preset=${job.preset ?? job.spec.preset} onOpen=${rest.onOpen} />`}
  </${JobFrame}>`;
}

function TrialTable({ found, presets, preset, onOpen }) {
  const names = Object.keys(found.items[0].parameters);
  return html`<div class="scrolled"><table class="trials" data-role="trials">
    <thead><tr><th scope="col">Trial</th>
      ${names.map((name) => html`<th scope="col" key=${name}><${FieldName}
        presets=${presets} path=${name} preset=${preset} /></th>`)}
      <th scope="col">State</th><th scope="col">${format.capital(LABELS[found.quantity])} (95 % interval)</th></tr></thead>
    <tbody>${found.items.map((one) => html`<tr key=${one.trial} class=${one.best ? "is-best" : ""}
      data-trial=${one.trial} data-best=${String(one.best)}>
      <th scope="row"><button type="button" class="quiet-button" title=${`Show job ${one.number}`}
        onClick=${() => onOpen(one.job)}>${one.trial}${one.best ? " ★" : ""}</button></th>
      ${names.map((name) => html`<td key=${name}>${shown(one.parameters[name])}</td>`)}
      <td title=${one.error ?? ""}>${stateOf(one)}</td>
      <td>${one.value ? format.interval(one.value) : "–"}</td></tr>`)}</tbody></table></div>`;
}

function shown(v) {
  return typeof v === "number" && !Number.isInteger(v) ? format.number(v, 4) : fieldValue(v);
}

function stateOf(one) {
  const share = one.total_steps ? Math.round((100 * one.step) / one.total_steps) : 0;
  return one.state === "running" ? `running, ${share} %` : one.state;
}

function TrialPlot({ found }) {
  const theme = useTheme();
  const options = useMemo(() => plotOptions(theme, LABELS[found.quantity]), [theme, found.quantity]);
  const data = useMemo(() => columns(found), [found]);
  return html`<${Plot} options=${options} data=${data} height=${200}
    label=${`${LABELS[found.quantity]} in percent of ${format.count(found.items.length, "trial")}`} />`;
}

function columns({ items, maximised }) {
  const better = maximised ? Math.max : Math.min;
  let best = null;
  const soFar = items.map(({ value }) => {
    if (value) best = best === null ? value.mean : better(best, value.mean);
    return best;
  });
  const row = (key) => items.map(({ value }) => value?.[key] ?? null);
  const marked = items.map((one) => (one.best ? one.value.mean : null));
  return [items.map((one) => one.trial), soFar, row("mean"), row("low"), row("high"), marked];
}

function plotOptions(theme, label) {
  const dots = (colour, size) => ({ stroke: colour, width: 0, paths: () => null,
    points: { show: true, size, fill: colour } });
  const end = { stroke: theme.faint, width: 0, paths: () => null, points: { show: true, size: 3 } };
  return {
    legend: { show: false },
    padding: [8, 16, 0, 0],
    cursor: { show: false },
    scales: { x: { time: false, range: (_, low, high) => [(low ?? 1) - 0.5, (high ?? 1) + 0.5] },
      y: { range: [0, 1] } },
    axes: [
      axis(theme, { size: 38, label: "trial", labelSize: 14, labelFont: "11px Inter, system-ui",
        incrs: [1, 2, 5, 10, 20, 50], values: (_, t) => t.map((v) => String(v)) }),
      axis(theme, { size: 46, label: `${label} [%]`, labelSize: 16, labelFont: "11px Inter, system-ui",
        values: (_, t) => t.map((v) => String(Math.round(100 * v))) }),
    ],
    series: [{}, { stroke: theme.faint, width: 1.25, spanGaps: true, points: { show: false } },
      dots(theme.accent, 7), end, end, dots(theme.good, 11)],
  };
}
