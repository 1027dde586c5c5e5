// What a visitor can do to a reach cell besides people and clock: goal, safety layer, policy.
import { html } from "./vendor/htm-preact-standalone.module.js";
import { Icon } from "./icons.js";

const GOAL_MODES = [
  ["jump", "Jumps on", "As soon as it is reached there is another one"],
  ["follow", "Follows me", "It stays where you drag it"],
];
const SAFETY = [
  [true, "On", "The robot obeys the safety layer"],
  [false, "Off", "See what happens without"],
];
const WAYS = {
  direct: ["Direct", "The policy is asked about this very goal"],
  interpolated: ["Interpolated", "The policy is asked about the targets around the goal"],
  averaged: ["All people", "The policy is asked about each person, the near ones count more"],
};

export function ReachControls({ world, send }) {
  const { goal_mode: mode, safety, way, ways } = world.reach;
  return html`<div class="dock-row dock-wrap">
    <span class="dock-label" id="goal-label">Goal</span>
    <${Segmented} labelledby="goal-label" name="goal-mode" value=${mode} items=${GOAL_MODES}
      onPick=${(one) => send({ tag: "set-goal-mode", mode: one })} />
    <button type="button" class="tool" data-action="new-goal" title="Draw another goal"
      onClick=${() => send({ tag: "new-goal" })}><${Icon} name="reset" />New goal</button>
    <span class="dock-pair"><span class="dock-label dock-label-free" id="layer-label">Safety layer</span>
      <${Segmented} labelledby="layer-label" name="safety" value=${safety.on} items=${SAFETY}
        onPick=${(on) => send({ tag: "set-safety", on })} /></span>
    ${ways.length > 1 && html`<span class="dock-pair">
      <span class="dock-label dock-label-free" id="way-label">Policy asked</span>
      <${Segmented} labelledby="way-label" name="way" value=${way}
        items=${ways.map((one) => [one, ...(WAYS[one] ?? [one, ""])])}
        onPick=${(one) => send({ tag: "set-way", way: one })} /></span>`}
    <p class="dock-hint">Drag the arrows at the goal in the scene.</p>
  </div>`;
}

/** A choice of one; `items` are [value, label, title]. */
export function Segmented({ labelledby, name, value, items, onPick }) {
  return html`<div class="segmented" role="radiogroup" aria-labelledby=${labelledby}>
    ${items.map(([one, label, title]) => html`<button key=${String(one)} type="button" role="radio"
      aria-checked=${String(one === value)} data-choice=${`${name}:${one}`} title=${title}
      onClick=${() => onPick(one)}>${label}</button>`)}
  </div>`;
}
