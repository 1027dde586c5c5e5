// What a visitor can do to a reach cell besides people and clock: goal, safety layer, policy.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Segmented } from "../choice.js";
import { Icon } from "../icons.js";

const GOAL_MODES = [
  ["jump", "Jumps on", "As soon as it is reached there is another one"],
  ["follow", "Follows me", "It stays where you drag it: take the arrows in the scene"],
];
const SAFETY = [
  ["assumed", "Worst case", "The robot obeys the safety layer: anybody may come from anywhere at the assumed speed"],
  ["measured", "As seen", "The layer goes by the velocities that people are seen with, and the policy keeps clear of it"],
  ["off", "Off", "See what happens without"],
];
const BETWEEN = [
  [true, "On", "The policy is asked about the targets around the goal, and their mean is taken"],
  [false, "Off", "The policy is asked about this very goal"],
];
const BESIDE = [
  [false, "the nearest", "The policy sees the nearest person"],
  [true, "everyone", "The policy is asked beside each person alone; the nearer one counts more"],
];
const AHEAD = [
  [true, "On", "Each decision is played ahead for a second, and changed where that ends in a contact"],
  [false, "Off", "The policy's action is taken as it is"],
];

export function ReachControls({ world, send }) {
  const { goal_mode: mode, safety, inference_mode: current, inference_modes: modes } = world.reach;
  const between = current.includes("interpolated");
  const averaged = current.includes("averaged");
  const ahead = current.endsWith("-rollout");
  const ask = (all, mixed, played) => {
    const asked = [all && "averaged", mixed && "interpolated"].filter(Boolean).join("-") || "direct";
    send({ tag: "set-inference-mode", inference_mode: played ? `${asked}-rollout` : asked });
  };
  return html`<div class="dock-row dock-wrap">
    <span class="dock-label" id="goal-label">Goal</span>
    <${Segmented} labelledby="goal-label" mark=${marked("goal-mode")} value=${mode} items=${GOAL_MODES}
      onPick=${(one) => send({ tag: "set-goal-mode", mode: one })} />
    <button type="button" class="tool" data-action="new-goal" title="Draw another goal"
      onClick=${() => send({ tag: "new-goal" })}><${Icon} name="reset" />New goal</button>
    <span class="dock-pair"><span class="dock-label dock-label-free" id="layer-label">Safety layer</span>
      <${Segmented} labelledby="layer-label" mark=${marked("safety")} value=${layerOf(safety)} items=${SAFETY}
        onPick=${(one) => send({ tag: "set-safety", on: one !== "off", ...(one !== "off" && { use_measured_velocity: one === "measured" }) })} /></span>
    ${modes.includes("interpolated") && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="between-label">Interpolation</span>
      <${Segmented} labelledby="between-label" mark=${marked("between")} value=${between} items=${BETWEEN}
        onPick=${(one) => ask(averaged, one, ahead)} /></span>`}
    ${modes.includes("direct-rollout") && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="ahead-label">Look ahead</span>
      <${Segmented} labelledby="ahead-label" mark=${marked("ahead")} value=${ahead} items=${AHEAD}
        onPick=${(one) => ask(averaged, between, one)} /></span>`}
    ${modes.includes("averaged") && world.people.length > 1 && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="beside-label">Policy sees</span>
      <${Segmented} labelledby="beside-label" mark=${marked("beside")} value=${averaged} items=${BESIDE}
        onPick=${(one) => ask(one, between, ahead)} /></span>`}
  </div>`;
}

/** Which of the choices holds for the safety layer. */
function layerOf({ on, use_measured_velocity: measured }) {
  if (!on) return "off";
  return measured ? "measured" : "assumed";
}

function marked(name) {
  return (one) => ({ "data-choice": `${name}:${one}` });
}
