// Controls of a reach cell: goal, safety layer, inference mode.
import { html, useRef } from "../vendor/htm-preact-standalone.module.js";
import { marked, Segmented } from "../choice.js";
import { Icon } from "../icons.js";
import { SafetyControls } from "../live/safetycontrols.js";

const GOAL_MODES = [
  ["jump", "New target when reached", "A reached goal is replaced by a random one"],
  ["follow", "Manual target", "The goal stays where you drag it with the arrows in the scene"],
];
const BETWEEN = [
  [true, "On", "Actions for the training targets around the goal are interpolated"],
  [false, "Off", "The policy is queried for the goal itself"],
];
const BESIDE = [
  [false, "Nearest person", "The observation contains the nearest person"],
  [true, "All people", "One action per person, weighted by inverse distance"],
];
const AHEAD = [
  [true, "On", "Each decision is simulated for 1 s; on a predicted contact an alternative is executed"],
  [false, "Off", "The action of the policy is executed unchanged"],
];

export function ReachControls({ world, send }) {
  const { goal_mode: mode, inference_mode: shown, inference_modes: modes } = world.reach;
  const clicked = useRef(null); // the mode of a click that the cell has not shown yet
  const { between, weighted, ahead } = switchesOf(clicked.current ?? shown);
  const ask = async (change) => {
    const name = modeOf({ ...switchesOf(clicked.current ?? shown), ...change });
    clicked.current = name;
    await send({ tag: "set-inference-mode", inference_mode: name });
    if (clicked.current === name) clicked.current = null;
  };
  return html`<div class="dock-row dock-wrap">
    <span class="dock-label" id="goal-label">Goal</span>
    <${Segmented} labelledby="goal-label" mark=${marked("goal-mode")} value=${mode} items=${GOAL_MODES}
      onPick=${(one) => send({ tag: "set-goal-mode", mode: one })} />
    <button type="button" class="tool" data-action="new-goal" title="Draw a random goal"
      onClick=${() => send({ tag: "new-goal" })}><${Icon} name="reset" />Random target</button></div>
    <div class="dock-row dock-wrap"><${SafetyControls} world=${world} send=${send} /></div>
    ${modes.length > 1 && html`<div class="dock-row dock-wrap"><span class="dock-label">Policy</span>
    ${modes.includes("interpolated") && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="between-label">Target interpolation</span>
      <${Segmented} labelledby="between-label" mark=${marked("between")} value=${between} items=${BETWEEN}
        onPick=${(one) => ask({ between: one })} /></span>`}
    ${modes.includes("direct-rollout") && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="ahead-label">Rollout check (1 s)</span>
      <${Segmented} labelledby="ahead-label" mark=${marked("ahead")} value=${ahead} items=${AHEAD}
        onPick=${(one) => ask({ ahead: one })} /></span>`}
    ${modes.includes("distance-weighted") && world.people.length > 1 && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="beside-label">Observed people</span>
      <${Segmented} labelledby="beside-label" mark=${marked("beside")} value=${weighted} items=${BESIDE}
        onPick=${(one) => ask({ weighted: one })} /></span>`}</div>`}`;
}

/** The switches of an inference mode. */
function switchesOf(mode) {
  return { between: mode.includes("interpolated"), weighted: mode.includes("distance-weighted"),
    ahead: mode.endsWith("-rollout") };
}

function modeOf({ between, weighted, ahead }) {
  const parts = [weighted && "distance-weighted", between && "interpolated"].filter(Boolean);
  return (parts.join("-") || "direct") + (ahead ? "-rollout" : "");
}
