// Who moves a walking cylinder, and how fast all of them walk.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Segmented } from "../choice.js";
import { Icon } from "../icons.js";

const MODES = [
  ["manual", "By hand", "You drag the handle in the scene", "hand"],
  ["auto", "Walks", "From one random place to the next", "walk"],
  ["still", "Stands", "Stays where it is", "stand"],
];
const SPEEDS = [["", "varies"], ["0.25", "0.25 m/s"], ["0.5", "0.5 m/s"], ["1", "1 m/s"],
  ["1.6", "1.6 m/s"]];

export function WalkerMover({ person, name, world, send }) {
  const { id, mode } = person;
  const { walk_speed: speed } = world.reach;
  const known = SPEEDS.some(([value]) => value === String(speed ?? ""));
  return html`<div class="dock-row dock-wrap">
    <span class="dock-label" id="mode-label">Moved by</span>
    <${Segmented} labelledby="mode-label" value=${mode} items=${MODES}
      mark=${(one) => ({ "data-mode": one })}
      onPick=${(one) => send({ tag: "set-mode", person: id, mode: one })} />
    <label class="dock-pair"><span class="dock-label dock-label-free">Speed</span>
      <select data-role="walk-speed" value=${String(speed ?? "")} title="How fast all people walk; as in training it varies between 0.3 and 1 m/s"
        onChange=${(e) => send({ tag: "set-walking-speed", speed: e.target.value === "" ? null : Number(e.target.value) })}>
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
