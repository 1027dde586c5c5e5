// Panel of the safety layer: override, separation distance with the terms of S_p, both over time.
import { html, useRef } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { overrideColour, TERMS } from "../palette.js";
import { nameOf } from "./people.js";
import { SAFETY_SPAN_S, SafetyHistory } from "./safetyhistory.js";
import { OverridePlot, SeparationPlot } from "./safetyplots.js";

const SLOW = 0.995;
const ARC = 2 * Math.PI * 40 * 0.75;
const LINKS = { base_link: "base", shoulder_link: "shoulder", upper_arm_link: "upper arm",
  forearm_link: "forearm", wrist_1_link: "wrist", wrist_2_link: "wrist", wrist_3_link: "tool" };

/** Whether a person nearer than S_p makes the layer slow the robot, or would, if it is disabled. */
export function isTooNear({ person, separation, required, advised }) {
  return person !== null && separation < required && advised < SLOW;
}

/** What the status chip says while the safety layer reduces the speed; null otherwise. */
export function safetyChip({ status, safety }) {
  if (!["moving", "picking"].includes(status) || !safety.on || safety.override >= SLOW) return null;
  return safety.override <= 0 ? ["Stopped", "bad"] : ["Slowed down", "warn"];
}

/** The safety layer: override, separation against what is needed, both over time. */
export function Safety({ world }) {
  const { safety } = world;
  const history = useRef(new SafetyHistory()).current;
  history.add(world);
  const share = (seconds) => (safety.moving_s > 0 ? format.percent(seconds / safety.moving_s, 0) : "–");
  return html`<section class="card" aria-labelledby="safety-title">
    <header class="card-head">
      <h2 id="safety-title">Speed and separation monitoring</h2>
      <span class="hint" tabindex="0" aria-describedby="safety-help">ISO 10218-2
        <span class="tip tip-left" role="tooltip" id="safety-help">The robot must be able to stop
          before a person ${safety.use_measured_velocity ? "at the measured velocity plus " : "moving at "}${
          safety.human_speed.toFixed(1)} m/s${safety.use_measured_velocity ? "" : ", or faster if seen so,"} can
          reach it. The layer checks the path ahead; S<sub>p</sub> is the bound of the standard, so near the
          limit the two differ slightly, and a robot that moves away may be faster. S<sub>p</sub> is the sum of
          the distances that person and robot cover until the robot has stopped, and of the margins. Not a
          certified safety function.</span>
      </span>
    </header>
    <div class="safety">
      <${Gauge} safety=${safety} />
      <${Terms} safety=${safety} people=${world.people ?? []} />
    </div>
    <div class="plot-head"><span>Override, last ${SAFETY_SPAN_S} s</span>
      ${!safety.on && html`<span class="faint"><i class="dashed-mark"></i>override of the layer</span>`}
    </div>
    <${OverridePlot} history=${history} on=${safety.on} />
    <div class="plot-head"><span>Separation distance and S<sub>p</sub></span></div>
    <${SeparationPlot} history=${history} />
    <dl class="facts">
      <div><dt>Below half speed</dt><dd>${share(safety.slowed_s)}</dd></div>
      <div><dt>Stopped</dt><dd>${share(safety.stopped_s)}</dd></div>
    </dl>
  </section>`;
}

/** The override as three quarters of a ring. */
function Gauge({ safety }) {
  const { on, override, advised } = safety;
  const percent = Math.round(override * 100);
  return html`<div class="gauge" role="meter" aria-label="Override in percent" aria-valuemin="0"
    aria-valuemax="100" aria-valuenow=${percent} data-role="override" data-override=${override.toFixed(3)}>
    <svg viewBox="0 0 100 100" aria-hidden="true">
      <circle cx="50" cy="50" r="40" class="gauge-back" stroke-dasharray=${`${ARC} 400`} />
      ${override > 0 && html`<circle cx="50" cy="50" r="40" class="gauge-fill"
        stroke=${on ? overrideColour(override) : "var(--ink-3)"}
        stroke-dasharray=${`${ARC * override} 400`} />`}
    </svg>
    <b>${percent}<small> %</small></b>
    <span>${on ? "speed override" : `disabled, would be ${format.percent(advised, 0)}`}</span>
  </div>`;
}

function Terms({ safety, people }) {
  const { person, link, separation, required, person_distance: person_m, robot_distance: robot_m, margin } = safety;
  if (person === null) {
    return html`<p class="empty">No person in the cell. Add a person below the scene.</p>`;
  }
  const subject = people.length > 1 ? nameOf(person) : "Person";
  const rows = [
    ["person", html`human contribution S<sub>h</sub>`, person_m],
    ["robot", html`robot reaction and stopping S<sub>r</sub> + S<sub>s</sub>`, robot_m],
    ["margin", "margins C + Z", margin],
  ];
  return html`<dl class="terms">
    <div class=${isTooNear(safety) ? "terms-top is-short" : "terms-top"}>
      <dt>${subject} to ${LINKS[link] ?? "robot"}</dt>
      <dd data-role="separation">${format.gap(separation)}</dd></div>
    <div class="terms-top"><dt>Protective separation distance S<sub>p</sub></dt><dd data-role="required">${format.length(required)}</dd></div>
    ${rows.map(([key, label, value]) => html`<div key=${key}><dt><i class="term" style=${{ background: TERMS[key] }}></i><span>${label}</span></dt>
      <dd>${format.length(value)}</dd></div>`)}
  </dl>`;
}
