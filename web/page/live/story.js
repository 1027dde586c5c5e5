// What the robot does and why, in one sentence, and the few numbers that matter beside it.
import { html } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";
import { nameOf } from "./people.js";

const STATUS = {
  moving: ["On its way", "accent"],
  picking: ["Picking", "good"],
  contact: ["Contact", "bad"],
  blocked: ["Waiting", "warn"],
  "case done": ["Case done", "good"],
  "no candidates": ["No goals", "quiet"],
  "no policy": ["No policy", "warn"],
  solved: ["Goal reached", "good"],
  reached: ["Goal reached", "good"],
};
const CLEARANCE_SCALE_M = 1.0;

/** `chip` says what the status is called where its own name is too coarse. */
export function Story({ world, chip = null }) {
  const [text, tone] = chip ?? judged(world) ?? STATUS[world.status] ?? [String(world.status), "quiet"];
  return html`<section class="story" aria-labelledby="story-title">
    <h2 id="story-title" class="sr">What the robot does and why</h2>
    <div class="story-top">
      <span class=${`chip chip-${world.paused ? "quiet" : tone}`} data-status=${world.status}
        role="status">
        ${world.paused ? "Paused" : text}</span>
      <span class="clock">${world.t_s.toFixed(1)} s</span>
    </div>
    <p class="sentence">${world.message || "Waiting for the first decision."}</p>
    ${world.verdict && html`<${Verdict} ...${world.verdict} />`}
    <${Clearance} metres=${world.clearance_m} people=${world.people ?? []} />
  </section>`;
}

/** A case that is done is called by its verdict. */
function judged({ status, verdict }) {
  if (status !== "case done" || !verdict) return null;
  return verdict.as_expected ? ["As expected", "good"] : ["Not as expected", "bad"];
}

/** What a case study or a test expects, what was observed, and whether both agree. */
function Verdict({ expected, observed, as_expected: agrees }) {
  const [text, tone] = agrees === null ? ["open", "quiet"]
    : agrees ? ["as expected", "good"] : ["not as expected", "bad"];
  return html`<dl class="verdict" data-role="verdict" data-as-expected=${String(agrees)}>
    <div><dt>Expected</dt><dd data-role="expected">${expected}</dd></div>
    <div><dt>Observed</dt><dd data-role="observed">${observed}</dd></div>
    <div><dt>Verdict</dt><dd><span class=${`chip chip-${tone}`}>${text}</span></dd></div>
  </dl>`;
}

function Clearance({ metres, people }) {
  const nearest = people.length > 1 && people.find((one) => one.nearest);
  const whom = nearest ? nameOf(nearest.id) : "the person";
  const known = Number.isFinite(metres);
  const share = known ? Math.min(1, Math.max(0, metres / CLEARANCE_SCALE_M)) : 0;
  const tone = !known ? "" : metres < 0.05 ? "bad" : metres < 0.15 ? "warn" : "good";
  return html`<div class="clearance">
    <span class="label">${people.length ? `Clearance to ${whom}` : "Nobody is in the cell"}</span>
    <span class="meter" role="meter" aria-label="Clearance to the nearest person in metres"
      aria-valuemin="0" aria-valuemax=${CLEARANCE_SCALE_M}
      aria-valuenow=${(share * CLEARANCE_SCALE_M).toFixed(2)} aria-valuetext=${format.gap(metres)}>
      <i class=${`meter-fill ${tone}`} style=${{ transform: `scaleX(${share})` }}></i>
    </span>
    <strong data-role="clearance">${format.gap(metres)}</strong>
  </div>`;
}

/** Counters, trained range and provenance: the small print under the plot. */
export function SmallPrint({ world }) {
  const counters = world.counters ?? {};
  const outside = world.outside ?? [];
  return html`<section class="card small-print" aria-label="Counters and provenance">
    <dl class="tiles">
      ${[["reached", "Reached"], ["contacts", "Contacts"], ["timeouts", "Out of time"],
        ["switches", "Changed mind"]].map(([key, label]) => html`<div key=${key}>
          <dt>${label}</dt><dd data-counter=${key}>${counters[key] ?? 0}</dd></div>`)}
    </dl>
    ${world.checkpoint && outside.length === 0 && html`<p class="range good"><${Icon} name="check" />
          The state lies inside what this policy was trained on.</p>`}
    ${outside.length > 0 && html`<div class="range warn"><${Icon} name="alert" /><div>
          Outside what this policy was trained on:
          <ul>${outside.slice(0, 4).map(outsideText).map(([name, text]) => html`<li key=${name}>
            <b>${name}</b> ${text}</li>`)}
            ${outside.length > 4 && html`<li>and ${outside.length - 4} more</li>`}
          </ul></div></div>`}
    ${world.checkpoint && html`<p class="provenance">Decided in
      ${` ${format.number(world.elapsed_ms, 2)} ms by checkpoint `}
      <code title=${world.checkpoint}>${format.short(world.checkpoint)}</code></p>`}
  </section>`;
}

/** "people[0].q.elbow_r" = 2.7 -> "person’s elbow r 155°, trained 0° to 149°". */
export function outsideText({ field, value, low, high }) {
  const show = inUnits(field);
  return [fieldName(field), `${show(value)}, trained ${show(low)} to ${show(high)}`];
}

function inUnits(field) {
  const speed = /\bqd\b/.test(field) ? "/s" : "";
  if (/time_left/.test(field)) return (v) => `${format.number(v)} s`;
  if (/pelvis_[xy]|position|tcp/.test(field)) return (v) => `${format.number(v)} m${speed}`;
  return (v) => `${format.number(Math.round((v * 180) / Math.PI))}°${speed}`;
}

function fieldName(field) {
  return String(field)
    .replace(/^people\[\d+\]\.q(d?)[.[]?/, (_, d) => (d ? "person’s speed of " : "person’s "))
    .replace(/^robot\.q(d?)[.[]?/, (_, d) => (d ? "robot’s speed of joint " : "robot’s joint "))
    .replace(/([a-z]+)_([rl])(?:_([a-z]+))?\]?$/, (_, joint, side, way) =>
      `${side === "r" ? "right" : "left"} ${joint} ${way ?? ""}`.trim())
    .replace(/[\]]/g, "")
    .replaceAll("_", " ");
}
