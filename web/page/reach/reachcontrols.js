// Controls of a reach cell: goal, safety layer, inference mode.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Segmented } from "../choice.js";
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
  const { goal_mode: mode, inference_mode: current, inference_modes: modes } = world.reach;
  const between = current.includes("interpolated");
  const weighted = current.includes("distance-weighted");
  const ahead = current.endsWith("-rollout");
  const ask = (all, mixed, played) => {
    const asked = [all && "distance-weighted", mixed && "interpolated"].filter(Boolean).join("-") || "direct";
    send({ tag: "set-inference-mode", inference_mode: played ? `${asked}-rollout` : asked });
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
        onPick=${(one) => ask(weighted, one, ahead)} /></span>`}
    ${modes.includes("direct-rollout") && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="ahead-label">Rollout check (1 s)</span>
      <${Segmented} labelledby="ahead-label" mark=${marked("ahead")} value=${ahead} items=${AHEAD}
        onPick=${(one) => ask(weighted, between, one)} /></span>`}
    ${modes.includes("distance-weighted") && world.people.length > 1 && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="beside-label">Policy sees</span>
      <${Segmented} labelledby="beside-label" mark=${marked("beside")} value=${weighted} items=${BESIDE}
        onPick=${(one) => ask(one, between, ahead)} /></span>`}</div>`}`;
}

function marked(name) {
  return (one) => ({ "data-choice": `${name}:${one}` });
}
