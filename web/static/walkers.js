// Who moves a walking cylinder, and how fast all of them walk.
import { html } from "./vendor/htm-preact-standalone.module.js";
import { Icon } from "./icons.js";

const MODES = [
  ["manual", "By hand", "hand", "You drag the handle in the scene"],
  ["auto", "Walks", "walk", "From one random place to the next"],
  ["still", "Stands", "stand", "Stays where it is"],
];
const SPEEDS = [["", "varies"], ["0.25", "0.25 m/s"], ["0.5", "0.5 m/s"], ["1", "1 m/s"],
  ["1.6", "1.6 m/s"]];

export function WalkerMover({ person, name, world, send }) {
  const { id, mode } = person;
  const { walk_speed: speed } = world.reach;
  const known = SPEEDS.some(([value]) => value === String(speed ?? ""));
  return html`<div class="dock-row dock-wrap">
    <span class="dock-label" id="mode-label">Moved by</span>
    <div class="segmented" role="radiogroup" aria-labelledby="mode-label">
      ${MODES.map(([one, label, icon, title]) => html`<button key=${one} type="button" role="radio"
        aria-checked=${String(one === mode)} data-mode=${one} title=${title}
        onClick=${() => send({ tag: "set-mode", person: id, mode: one })}>
        <${Icon} name=${icon} />${label}</button>`)}
    </div>
    <label class="dock-pair"><span class="dock-label dock-label-free">Speed</span>
      <select data-role="walk-speed" value=${String(speed ?? "")} title="How fast all people walk; as in training it varies between 0.3 and 1 m/s"
        onChange=${(e) => send({ tag: "set-walk", speed: e.target.value === "" ? null : Number(e.target.value) })}>
        ${SPEEDS.map(([value, label]) => html`<option key=${value} value=${value}>${label}</option>`)}
        ${!known && html`<option value=${String(speed)}>${speed} m/s</option>`}
      </select></label>
    <div class="transport" role="group" aria-label=${`${name} in the cell`}>
      <button type="button" class="tool" data-action="remove-person" aria-label=${`Remove ${name}`}
        title=${`${name} leaves the cell`} onClick=${() => send({ tag: "remove-person", person: id })}>
        <${Icon} name="close" /><span>Remove</span></button>
    </div>
  </div>`;
}
