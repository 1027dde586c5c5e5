// Sorting moves: the present move, its source (policy or planner), and the ranking.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Block, nameOf, placeName } from "./block-icon.js";
import { TaskPlanner } from "../training/checkpoints.js";
import * as format from "../format.js";
import { Tiles } from "../live/status.js";

const PHASES = {
  approach: "moving to it",
  grasp: "grasping",
  carry: "carrying",
  place: "placing",
};

export function Moves({ sorting, cell }) {
  const { move, ranked } = sorting;
  const values = ranked.map((one) => one.value).filter((v) => Number.isFinite(v));
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const share = (v) => (high > low ? 0.12 + (0.88 * (v - low)) / (high - low) : 1);
  const isChosen = (one) => move && one.pick === move.pick && one.place === move.place;
  return html`<section class="card" aria-labelledby="moves-title">
    <header class="card-head">
      <h2 id="moves-title">Next move</h2>
      <${Decider} sorting=${sorting} />
    </header>
    ${ranked.length === 0
      ? html`<p class="empty" data-role="no-moves">${idle(sorting)}</p>`
      : html`<ol class="ranks">
          ${ranked.map((one) => html`<${Rank} key=${`${one.pick}-${one.place}`} move=${one}
            sorting=${sorting} cell=${cell} chosen=${isChosen(one)}
            share=${Number.isFinite(one.value) ? share(one.value) : 0} />`)}
        </ol>`}
    ${sorting.duplicates.length > 1 && html`<p class="faint duplicates">${sorting.duplicates.length} equal moves;
      the critic of the pick policy selected one.</p>`}
  </section>`;
}

function idle(sorting) {
  if (sorting.goal.length === 0) return "Nothing to do: there is no goal. Add blocks to it above.";
  return sorting.solved ? "Nothing to do: the goal is reached." : "No move is evaluated yet.";
}

function Decider({ sorting }) {
  const { decided_by: by, phase, sorting_policy: policy, counters } = sorting;
  if (!by) return html`<span class="faint">${policy ? "learned policy" : "exact planner"}</span>`;
  const over = by === "planner" && policy !== null;
  const text = by === "policy" ? "by the policy" : over ? "planner fallback" : "by the planner";
  const help = by === "policy"
    ? "The sorting policy values every move. The best is chosen, or another with about as many expected grasps."
    : over
      ? "The exact planner decides: the policy made no progress, or was not trained for this task."
      : "No sorting policy is active: the exact planner finds the fewest moves. The value of a move is minus its expected number of grasps.";
  return html`<span class=${over ? "hint is-over" : "hint"} tabindex="0" data-role="decider"
    data-by=${by} aria-describedby="decider-help">${text}${PHASES[phase] ? `, ${PHASES[phase]}` : ""}
    <span class="tip tip-left" role="tooltip" id="decider-help">${help}${counters.planner_fallbacks > 0
      ? ` Fallbacks so far: ${counters.planner_fallbacks}.`
      : ""}</span></span>`;
}

function Rank({ move, sorting, cell, chosen, share }) {
  const id = move.block ?? (chosen ? sorting.move.block : null);
  const block = sorting.blocks.find((one) => one.id === id);
  const from = format.capital(placeName(cell, move.pick));
  const to = placeName(cell, move.place);
  const what = block ? nameOf(block) : "block";
  const why = [worth(move.value, sorting.decided_by),
    move.best ? "It begins a shortest plan." : "It makes the plan longer."].join(" ");
  return html`<li class=${chosen ? "rank is-chosen" : "rank"} data-rank=${`${move.pick}-${move.place}`}
    data-chosen=${String(chosen)} title=${why}>
    <span class="sr">${what}</span>
    ${block ? html`<${Block} ...${block} sizes=${sorting.sizes} />` : html`<span></span>`}
    <span class="rank-path">${from} <i aria-hidden="true">→</i><span class="sr">to</span> ${to}</span>
    <span class="bar-track" aria-hidden="true">
      <i class="bar-fill" style=${{ left: 0, width: `${100 * share}%` }}></i></span>
    <span class="bar-value">${format.value(move.value)}</span>
    <span class="bar-note">${chosen ? html`<b class="tag tag-chosen">chosen</b>`
      : move.best ? html`<b class="tag">shortest</b>` : ""}</span>
  </li>`;
}

/** The planner values a move by the grasps it leads to, the policy by reward. */
function worth(value, by) {
  if (!Number.isFinite(value)) return "";
  return by === "planner"
    ? `Expected grasps to the goal if it comes first: ${format.number(-value, 2)}.`
    : `Expected discounted reward if it comes first: ${format.value(value)}.`;
}

const ORDERS = [
  ["critic", "critic of the pick policy"],
  ["planner", "task planner's first"],
  ["nearest", "nearest block"],
];

/** What decides among moves with about the same expected grasps. */
function Order({ order, send }) {
  return html`<label class="sorting-policy"><span>Among equal moves</span>
    <select value=${order} data-role="order"
      onChange=${(event) => send({ tag: "set-order", order: event.target.value })}>
      ${ORDERS.map(([value, text]) => html`<option key=${value} value=${value}>${text}</option>`)}
    </select></label>`;
}

/** Counters, the task planner and the order of equal moves. */
export function SortingSmallPrint({ world, cell, checkpoints, jobs, send }) {
  const counters = { ...world.sorting.counters, ...world.counters };
  return html`<section class="card small-print" aria-label="Counters and provenance">
    <${Tiles} world=${world} counters=${counters} names=${{ attempts: "Grasps", failures: "Failed", moves: "Moves",
      planner_fallbacks: "Planner fallbacks", contacts: "Contacts",
      contacts_at_rest: "Contacts at standstill" }} />
    <${TaskPlanner} sorting=${world.sorting} cell=${cell} checkpoints=${checkpoints} jobs=${jobs}
      send=${send} />
    <${Order} order=${world.sorting.order} send=${send} />
    <p class="range">${world.checkpoint
      ? html`<span>Motions by ${world.policy_title ?? "checkpoint"}
          ${" "}<code title=${world.checkpoint}>${format.short(world.checkpoint)}</code>.</span>`
      : html`<span>No policy moves the arm.</span>`}</p>
  </section>`;
}
