// Panel of a reach cell: status, safety layer, outcomes.
import { html } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";
import { Safety } from "../live/safety.js";
import { Provenance, StatusPanel, Tiles, TrainingRange } from "../live/status.js";

export function ReachDecision({ world }) {
  return html`<${StatusPanel} world=${world} />
    ${!world.checkpoint && html`<div class="notice warn" data-role="no-policy"><${Icon} name="alert" />
      <span>No reach policy is active. The robot moves straight to the goal without avoiding
        people; only the safety layer slows it down. Train <b>reach-td3</b> under Training, or choose a
        checkpoint above.</span></div>`}
    <${Safety} world=${world} />
    <${Outcomes} world=${world} />`;
}

/** Outcome counters, training range and provenance. */
function Outcomes({ world }) {
  const { counters, reach } = world;
  return html`<section class="card small-print" aria-label="Outcomes and provenance">
    <${Tiles} world=${world} counters=${counters} names=${{ reached: "Reached", contacts: "Contacts",
      contacts_at_rest: "Contacts at standstill", timeouts: "Timed out" }} />
    <dl class="facts">
      <div><dt>Mean time to a goal</dt><dd>${counters.reached
        ? format.seconds(reach.counters.reaching_s / counters.reached) : "–"}</dd></div>
    </dl>
    ${counters.contacts_at_rest > 0 && html`<p class="range"><${Icon} name="alert" /><span>Contact at
      standstill: a person touched the robot while it stood still. People in this cell do not avoid
      the robot.</span></p>`}
    <${TrainingRange} world=${world} />
    <${Provenance} world=${world} />
  </section>`;
}
