// Controls of the cell: people, clock, goals, scenarios.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { count } from "../format.js";
import { Icon } from "../icons.js";
import { People } from "./people.js";
import { Scenarios } from "./scenarios.js";
import { SafetyControls } from "./safetycontrols.js";
import { ReachControls } from "../reach/reachcontrols.js";
import { useListFocus } from "../listfocus.js";

const SPEEDS = [1, 2, 4, 8];
/** What gets the focus when a person has left. */
const SHOWN_PERSON = '[data-person][aria-pressed="true"], [data-action="add-person"]';

export function Controls({ world, cell, cases, send, colourOf, labelOf }) {
  const tests = cell?.sorting_tests ?? [];
  const dock = useListFocus(SHOWN_PERSON);
  return html`<section class="dock" aria-label="Controls of the cell" ref=${dock}>
    <${People} world=${world} send=${send}>
      <div class="transport" role="group" aria-label="Clock">
        <button type="button" class="tool" onClick=${() =>
          send({ tag: world.paused ? "resume" : "pause" })} data-action="pause"
          aria-label=${world.paused ? "Resume" : "Pause"}
          title=${world.paused ? "The cell goes on" : "The cell stands still"}>
          <${Icon} name=${world.paused ? "play" : "pause"} filled=${world.paused} />
          <span>${world.paused ? "Resume" : "Pause"}</span></button>
        <button type="button" class="tool" disabled=${!world.paused} data-action="step"
          aria-label="Step"
          title=${world.paused ? "Go on for one decision" : "Pause first: a step is one decision"}
          onClick=${() => send({ tag: "step" })}><${Icon} name="step" /><span>Step</span></button>
        <button type="button" class="tool" data-action="reset" aria-label="Reset"
          title="Robot and people start again"
          onClick=${() => send({ tag: "reset" })}><${Icon} name="reset" /><span>Reset</span></button>
        <select value=${world.speed} data-role="speed" aria-label="Speed of the clock"
          title="How fast the clock runs"
          onChange=${(e) => send({ tag: "set-speed", factor: Number(e.target.value) })}>
          ${SPEEDS.map((one) => html`<option key=${one} value=${one}>${one}×</option>`)}
        </select>
      </div>
    </${People}>
    ${world.reach ? html`<${ReachControls} world=${world} send=${send} />`
      : world.sorting
      ? html`<div class="dock-row dock-wrap"><${SafetyControls} world=${world} send=${send} /></div>
        ${tests.length > 0 && html`<${Scenarios} label="Benchmark tasks" items=${tests} tag="start-test"
          running=${world.sorting.test} send=${send}
          hint=${`${count(tests.length, "sorting test")} of the thesis: the cell is set up and the robot sorts.`} />`}`
      : html`<div class="dock-row">
          <span class="dock-label" id="goals-label">Goals</span>
          <${Goals} world=${world} cell=${cell} send=${send} colourOf=${colourOf}
            labelOf=${labelOf} />
        </div>
        <div class="dock-row dock-wrap"><${SafetyControls} world=${world} send=${send} /></div>
        ${cases.length > 0 && html`<${Scenarios} label="Scenarios" items=${cases} tag="start-case"
          running=${world.case} send=${send}
          hint=${`${count(cases.length, "case study", "case studies")} of thesis table 5.3: the person reaches in, the robot selects the better goal.`} />`}`}
  </section>`;
}

function Goals({ world, cell, send, colourOf, labelOf }) {
  if (!cell) return html`<p class="dock-note">The goals of this cell could not be loaded.</p>`;
  const active = new Set(world.selected ?? world.candidates.map((c) => c.id));
  return html`<div class="goals" role="group" aria-labelledby="goals-label">
    ${(cell?.stations ?? []).map(({ id }) => {
      const on = active.has(id);
      return html`<button key=${id} type="button" class="goal" aria-pressed=${String(on)}
        data-goal=${id} title=${labelOf(id)} onClick=${() => send({ tag: "toggle-candidate", id })}>
        <i class="swatch" style=${on ? { background: colourOf(id) } : {}}></i>
        <span>${labelOf(id)}</span></button>`;
    })}
  </div>`;
}
