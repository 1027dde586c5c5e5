// Motion source of a walking cylinder, and the walking speed of all people.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Segmented } from "../choice.js";
import { Icon } from "../icons.js";

const MODES = [
  ["manual", "Manual", "You drag the handle in the scene", "hand"],
  ["auto", "Walks", "From one random place to the next", "walk"],
  ["still", "Idle", "Stays where it is", "stand"],
];
const SPEEDS = [["", "Variable"], ["0.25", "0.25 m/s"], ["0.5", "0.5 m/s"], ["1", "1 m/s"],
  ["1.6", "1.6 m/s"]];

/** A person leaves; the second click of a double one would remove the next person. */
export function RemovePerson({ person, name, send }) {
  return html`<button type="button" class="tool" data-action="remove-person" aria-label=${`Remove ${name}`}
    title=${`${name} leaves the cell`}
    onClick=${({ detail }) => detail < 2 && send({ tag: "remove-person", person })}>
    <${Icon} name="close" /><span>Remove</span></button>`;
}

export function PedestrianControls({ person, name, world, send }) {
  const { id, mode } = person;
  const { walk_speed: speed } = world.reach;
  const known = SPEEDS.some(([value]) => value === String(speed ?? ""));
  return html`<div class="dock-row dock-wrap">
    <span class="dock-label" id="mode-label">Motion source</span>
    <${Segmented} labelledby="mode-label" value=${mode} items=${MODES}
      mark=${(one) => ({ "data-mode": one })}
      onPick=${(one) => send({ tag: "set-mode", person: id, mode: one })} />
    <label class="dock-pair"><span class="dock-label dock-label-free">Speed</span>
      <select data-role="walk-speed" value=${String(speed ?? "")} title="Walking speed of all people; variable: 0.3 to 1 m/s, as in training"
        onChange=${(e) => send({ tag: "set-walking-speed", speed: e.target.value === "" ? null : Number(e.target.value) })}>
        ${SPEEDS.map(([value, label]) => html`<option key=${value} value=${value}>${label}</option>`)}
        ${!known && html`<option value=${String(speed)}>${speed} m/s</option>`}
      </select></label>
    <div class="transport" role="group" aria-label=${`${name} in the cell`}>
      <${RemovePerson} person=${id} name=${name} send=${send} />
    </div>
  </div>`;
}
