// Status panel: what the robot does and why, in one sentence, with the main numbers.
import { html } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";
import { nameOf } from "./people.js";
import { isTooNear, safetyChip } from "./safety.js";

const STATUS = {
  moving: ["Moving to target", "accent"],
  picking: ["Picking", "good"],
  contact: ["Contact", "bad"],
  blocked: ["Waiting", "warn"],
  "case done": ["Scenario ended", "good"],
  "no candidates": ["No goals", "quiet"],
  "no policy": ["No policy", "warn"],
  solved: ["Goal reached", "good"],
  reached: ["Goal reached", "good"],
};
const CLEARANCE_SCALE_M = 1.0;
const NOUNS = { protract: "protraction", elevate: "elevation", flex: "flexion", abduct: "abduction",
  rotate: "rotation" };

/** `chip` replaces the name of the status where a more specific one exists. */
export function StatusPanel({ world, chip = null }) {
  const [text, tone] = safetyChip(world) ?? chip ?? judged(world) ?? STATUS[world.status] ?? [String(world.status), "quiet"];
  return html`<section class="story" aria-labelledby="story-title">
    <h2 id="story-title" class="sr">What the robot does and why</h2>
    <div class="story-top">
      <span class="story-state" role="status">
        ${world.paused && html`<span class="chip">Paused</span>${" "}`}
        <span class=${`chip chip-${tone}`} data-status=${world.status}>${text}</span>
      </span>
      <span class="clock">${format.seconds(world.t_s)}</span>
    </div>
    <p class="sentence">${format.typeset(world.message || "Waiting for the first decision.")}</p>
    ${world.verdict && html`<${Verdict} ...${world.verdict} />`}
    <${Clearance} metres=${world.clearance_m} people=${world.people ?? []} safety=${world.safety} />
  </section>`;
}

/** The verdict of a scenario that has ended. */
function judged({ status, verdict }) {
  if (status !== "case done" || !verdict) return null;
  return verdict.as_expected ? ["As expected", "good"] : ["Not as expected", "bad"];
}

/** Expected and observed behaviour of a scenario or benchmark task, and the verdict. */
function Verdict({ expected, observed, as_expected: agrees }) {
  const [text, tone] = agrees === null ? ["open", "quiet"]
    : agrees ? ["as expected", "good"] : ["not as expected", "bad"];
  return html`<dl class="verdict" data-role="verdict" data-as-expected=${String(agrees)}>
    <div><dt>Expected</dt><dd data-role="expected">${expected}</dd></div>
    <div><dt>Observed</dt><dd data-role="observed">${format.typeset(observed)}</dd></div>
    <div><dt>Verdict</dt><dd><span class=${`chip chip-${tone}`}>${text}</span></dd></div>
  </dl>`;
}

function Clearance({ metres, people, safety }) {
  const nearest = people.length > 1 && people.find((one) => one.nearest);
  const person = nearest ? nameOf(nearest.id) : "the person";
  const known = Number.isFinite(metres);
  const share = known ? Math.min(1, Math.max(0, metres / CLEARANCE_SCALE_M)) : 0;
  const short = safety.on && isTooNear(safety);
  const tone = !known ? "" : metres < 0.05 ? "bad" : short || metres < 0.15 ? "warn" : "good";
  return html`<div class="clearance">
    <span class="label">${people.length ? `Separation distance to ${person}` : "No person in the cell"}</span>
    <span class="meter" role="meter" aria-label="Separation distance to the nearest person in metres"
      aria-valuemin="0" aria-valuemax=${CLEARANCE_SCALE_M}
      aria-valuenow=${(share * CLEARANCE_SCALE_M).toFixed(2)} aria-valuetext=${format.gap(metres)}>
      <i class=${`meter-fill ${tone}`} style=${{ transform: `scaleX(${share})` }}></i>
    </span>
    <strong data-role="clearance">${format.gap(metres)}</strong>
  </div>`;
}

/** Counters, training range and provenance. */
export function SmallPrint({ world }) {
  return html`<section class="card small-print" aria-label="Counters and provenance">
    <${Tiles} world=${world} counters=${world.counters ?? {}} names=${{ reached: "Picked", broken_off: "Broken off",
      contacts: "Contacts", contacts_at_rest: "Contacts at standstill", timeouts: "Timed out",
      switches: "Target switches" }} />
    <${TrainingRange} world=${world} />
    <${Provenance} world=${world} />
  </section>`;
}

/** Counters by the names of `names`, in its order, and their rates over the time of the world. */
export function Tiles({ world, counters, names }) {
  return html`<dl class="tiles">${Object.entries(names).map(([key, label]) => html`<div key=${key}>
    <dt>${label}</dt><dd data-counter=${key}>${counters[key] ?? 0}</dd>
    <dd class="rate">${format.perHour(counters[key] ?? 0, world.t_s)}</dd></div>`)}</dl>`;
}

/** Whether the inputs of the last decision lie within the training range, and those that do not. */
export function TrainingRange({ world: { elapsed_ms: ms, outside: listed, people, candidates } }) {
  const outside = listed ?? [];
  const inside = outside.length === 0 && !candidates.some((one) => one.outside?.length);
  return html`${Number.isFinite(ms) && inside && html`<p class="range good"><${Icon} name="check" />
        In distribution: all inputs within the training range.</p>`}
  ${outside.length > 0 && html`<div class="range warn"><${Icon} name="alert" /><div>
        Out of distribution: inputs outside the training range
        <ul>${outside.slice(0, 4).map((one) => outsideText(one, people)).map(([name, text]) => html`<li key=${name}>
          <b>${name}</b> ${text}</li>`)}
          ${outside.length > 4 && html`<li>and ${outside.length - 4} more</li>`}
        </ul></div></div>`}`;
}

/** Checkpoint of the policy, and how long its decision took where there is one. */
export function Provenance({ world: { checkpoint, elapsed_ms: ms } }) {
  return checkpoint && html`<p class="provenance">
    ${Number.isFinite(ms) ? `Decided in ${format.quantity(ms, "ms", 2)} by checkpoint ` : "Checkpoint "}
    <code title=${checkpoint}>${format.short(checkpoint)}</code></p>`;
}

/**
 * "people[0].q.elbow_r" = 2.7 -> "right elbow", "155°, training range 0° to 149°"; the name begins
 * with that of the person where `people`, those of the world, are several.
 */
export function outsideText({ field, value, low, high }, people = []) {
  const show = inUnits(field);
  const person = people.length > 1 && people[/^people\[(\d+)\]/.exec(field)?.[1]];
  const name = person ? `${nameOf(person.id)}: ${fieldName(field)}` : fieldName(field);
  return [name, `${show(value)}, training range ${show(low)} to ${show(high)}`];
}

/** Names of the observed variables of a walker. */
const WALKER = { x: "position x", y: "position y", vx: "speed along x", vy: "speed along y", r: "radius",
  growth: "growth of the radius" };

function walkerVariable(field) {
  return /^people\[\d+\]\.(\w+)$/.exec(field)?.[1];
}

function inUnits(field) {
  const speed = /\bqd\b/.test(field) ? "/s" : "";
  const variable = walkerVariable(field);
  if (field === "people") return (v) => format.number(v);
  if (variable in WALKER) return (v) => format.quantity(v, /^(v.|growth)$/.test(variable) ? "m/s" : "m");
  if (/time_left/.test(field)) return (v) => format.quantity(v, "s");
  if (/pelvis_[xy]\b|position|tcp|^goal\b/.test(field)) return (v) => format.quantity(v, `m${speed}`);
  return (v) => `${format.number(Math.round((v * 180) / Math.PI))}°${speed}`;
}

function fieldName(field) {
  if (field === "people") return "number of people";
  return WALKER[walkerVariable(field)] ?? String(field)
    .replace(/^people\[\d+\]\.q(d?)[.[]?/, (_, d) => (d ? "speed of " : ""))
    .replace(/^robot\.q(d?)[.[]?/, (_, d) => (d ? "robot speed of joint " : "robot joint "))
    .replace(/([a-z]+)_([rl])(?:_([a-z]+))?\]?$/, (_, joint, side, direction) =>
      `${side === "r" ? "right" : "left"} ${joint} ${NOUNS[direction] ?? direction ?? ""}`.trim())
    .replace(/[\]]/g, "")
    .replace(/_s$/, "")
    .replaceAll(/[_.]/g, " ");
}
