// Value estimates of the candidates: bars with explanations, and a plot over time.
import { html, useMemo, useState } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { SPAN_S } from "./history.js";
import { ValuePlot } from "../plots.js";
import { outsideText } from "./status.js";
import { valueRange } from "./value-plot.js";

export function Values({ world, cell, history, colourOf, labelOf }) {
  const [at, setAt] = useState(null);
  const order = (cell?.stations ?? []).map((s) => s.id);
  const stamp = history.samples.at(-1)?.t ?? 0;
  const ids = useMemo(() => history.ids(order), [stamp, order.length]);
  const rows = [...world.candidates].sort((a, b) => order.indexOf(a.id) - order.indexOf(b.id));
  const chosen = rows.find((c) => c.id === world.chosen);
  const scale = useMemo(() => bounds(history, rows), [stamp]);
  const past = history.samples[at] ?? null;
  return html`<section class="card" aria-labelledby="values-title">
    <header class="card-head">
      <h2 id="values-title">Value estimates${Number.isFinite(world.decided_s)
        && html`, <span class="decided" data-role="decided">at ${format.seconds(world.decided_s)}</span>`}</h2>
      <span class="hint" tabindex="0" aria-describedby="values-help">Q(s, π(s))
        <span class="tip tip-left" role="tooltip" id="values-help">The critic estimates the expected
          discounted reward of moving to each candidate now: reaching it is rewarded, delay and
          contact cost. The highest value is chosen; a small bonus for the present target prevents
          oscillation. Percentage and seconds are the probability of success and the expected time
          to it, fitted to outcomes.</span>
      </span>
    </header>
    ${rows.length === 0
      ? html`<p class="empty">No candidates. Choose at least one goal below the scene.</p>`
      : html`<ul class="bars">
          <li class="bar-head" aria-hidden="true"><span>Q</span>
            ${rows.some((c) => Number.isFinite(c.success)) && html`<span>success</span><span>time</span>`}</li>
          ${rows.map((c) => html`<${Bar} key=${c.id} candidate=${c} chosen=${chosen}
            isChosen=${c.id === world.chosen} colour=${colourOf(c.id)} label=${labelOf(c.id)}
            rank=${rankOf(c, rows)} scale=${scale} />`)}
        </ul>`}
    <div class="plot-head">
      <span>Q over the last ${SPAN_S} s</span>
      <span class="readout" aria-hidden="true">${past
        ? html`<${Readout} past=${past} age=${history.age(at)} labelOf=${labelOf} />`
        : html`<span class="faint"><i class="switch-mark"></i>target switch</span>`}</span>
    </div>
    <${ValuePlot} history=${history} ids=${ids} labelOf=${labelOf} colourOf=${colourOf}
      chosen=${world.chosen} onHover=${setAt} />
  </section>`;
}

/** Under the cursor: when, what was chosen, and the best of the others. */
function Readout({ past, age, labelOf }) {
  const others = [...past.values].filter(([id, v]) => id !== past.chosen && Number.isFinite(v));
  const [next] = others.sort((a, b) => b[1] - a[1]);
  const chosen = past.values.get(past.chosen);
  return html`<span class="faint">${format.quantity(age, "s", 2)}</span>
    ${past.chosen && html`<span class="strong">${labelOf(past.chosen)} ${format.value(chosen)}</span>`}
    ${next && html`<span>${labelOf(next[0])} ${format.value(next[1])}</span>`}`;
}

function Bar({ candidate, chosen, isChosen, colour, label, rank, scale }) {
  const { id, value, reachable } = candidate;
  const outside = candidate.outside ?? [];
  const known = Number.isFinite(value);
  const zero = scale.at(0);
  const end = known ? scale.at(value) : zero;
  const bar = { left: `${Math.min(zero, end)}%`, width: `${Math.abs(end - zero)}%`,
    background: colour };
  const classes = ["bar", isChosen && "is-chosen", reachable === false && "is-unreachable"];
  return html`<li class=${classes.filter(Boolean).join(" ")} tabindex="0" data-candidate=${id}
    data-chosen=${isChosen ? "true" : "false"} aria-describedby=${`tip-${id}`}>
    <span class="bar-name"><i class="swatch" style=${{ background: colour }}></i>
      ${rank && html`<b class="bar-rank" aria-label=${`rank ${rank}`}>${rank}.</b>`}
      <span title=${label}>${label}</span></span>
    <span class="bar-track">
      <i class="bar-zero" style=${{ left: `${zero}%` }}></i>
      <i class="bar-fill" style=${bar}></i>
    </span>
    <span class="bar-value"><span class="sr">Q </span>${format.value(value)}</span>
    <span class="bar-odds" data-role="success">${Number.isFinite(candidate.success)
      && html`<span class="sr">success </span>${format.percent(candidate.success, 0)}`}</span>
    <span class="bar-odds" data-role="time">${Number.isFinite(candidate.time_s)
      && html`<span class="sr">expected time </span>${format.seconds(candidate.time_s)}`}</span>
    <span class="bar-note">${note(isChosen, reachable, outside)}</span>
    <span class="tip" role="tooltip" id=${`tip-${id}`}>${explain(candidate, chosen, label)}</span>
  </li>`;
}

/** 1 for the highest value of all rows; null where none is known. */
function rankOf({ value }, rows) {
  return Number.isFinite(value) ? 1 + rows.filter((one) => one.value > value).length : null;
}

function note(isChosen, reachable, outside) {
  if (isChosen) return html`<b class="tag tag-chosen">chosen</b>`;
  if (reachable === false) return html`<b class="tag tag-warn">out of reach</b>`;
  if (outside.length) return html`<b class="tag tag-warn">out of distribution</b>`;
  return "";
}

function explain({ id, value, reachable, success, contact, time_s: time, outside = [] }, chosen,
  label) {
  const parts = [];
  if (Number.isFinite(value)) {
    parts.push(`Expected discounted reward of moving to ${label} now: ` +
      `${format.value(value)}.`);
    if (chosen && chosen.id !== id && Number.isFinite(chosen.value)) {
      const gap = value - chosen.value;
      parts.push(gap < 0
        ? `${format.value(-gap)} less than the chosen one.`
        : `${format.value(gap)} more than the chosen one: not enough to switch yet.`);
    } else if (chosen?.id === id) parts.push("It is the present target.");
  } else parts.push(`No value for ${label} yet.`);
  if (Number.isFinite(success)) {
    parts.push(`Probability of success ${format.percent(success, 0)}, of a contact `
      + `${format.percent(contact, 0)}; expected time ${format.seconds(time)}.`);
  }
  if (reachable === false) parts.push("No configuration with the tool pointing down reaches it.");
  for (const o of outside) parts.push(`Out of distribution: ${outsideText(o).join(" ")}.`);
  return parts.join(" ");
}

/** A steady scale for the bars: all that the plot shows, and zero. */
function bounds(history, rows) {
  const seen = history.samples.flatMap((s) => [...s.values.values()]);
  const all = [...seen, ...rows.map((r) => r.value)].filter((v) => Number.isFinite(v));
  const [least, most] = valueRange(Math.min(0, ...all), Math.max(0, ...all));
  const low = Math.floor(least * 2) / 2;
  const high = Math.max(low + 1, Math.ceil(most * 2) / 2);
  return { at: (v) => (100 * (Math.min(high, Math.max(low, v)) - low)) / (high - low) };
}
