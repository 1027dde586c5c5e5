// The blocks that are there: a plan of the clutter on its failure map, from which blocks are
// picked to be moved or taken away, and a shelf from which more are added.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Block, kindOf, nameOf, placeName } from "./block-icon.js";
import { capital, count, percent } from "../format.js";
import { failureColours, failureGradient } from "../palette.js";

export function Blocks({ sorting, cell, send, picked, onPick }) {
  const slots = cell.stations.filter((one) => one.kind === "clutter");
  const held = sorting.blocks.find((one) => one.held);
  const block = sorting.blocks.find((one) => one.id === picked);
  const at = slots.find((one) => one.id === picked && !blockIn(sorting, one.id));
  return html`<section class="card" aria-labelledby="blocks-title">
    <header class="card-head">
      <h2 id="blocks-title" tabindex="-1">Blocks</h2>
      <span class="faint">${sorting.blocks.length} of at most ${slots.length}</span>
    </header>
    <${Plan} slots=${slots} sorting=${sorting} picked=${picked} onPick=${onPick} />
    <${Legend} failure=${sorting.failure} />
    ${block
      ? html`<${Picked} key=${block.id} block=${block} slots=${slots} cell=${cell}
          sorting=${sorting} send=${send} onPick=${onPick} />`
      : html`<${Shelf} sorting=${sorting} at=${at} slots=${slots} send=${send} />`}
    ${held && html`<p class="faint held" data-role="held">The ${nameOf(held)} is held by the gripper.</p>`}
  </section>`;
}

const blockIn = (sorting, id) => sorting.blocks.find((one) => one.place === id && !one.held);

/** The clutter from above, the robot's side below. */
function Plan({ slots, sorting, picked, onPick }) {
  const columns = places(slots, 0);
  const rows = places(slots, 1).reverse();
  return html`<div class="plan" role="group" aria-label="Clutter slots from above"
    style=${{ "--columns": columns.length }}>
    ${slots.map((one, index) => {
      const block = blockIn(sorting, one.id);
      const { background, ink } = failureColours(sorting.failure[index]);
      const chance = percent(sorting.failure[index], 0);
      const id = block?.id ?? one.id;
      return html`<button type="button" key=${one.id} class="plan-cell" data-cell=${one.id}
        data-block=${block?.id} aria-pressed=${String(picked === id)}
        style=${{ background, color: ink, gridColumn: columns.indexOf(place(one, 0)) + 1,
          gridRow: rows.indexOf(place(one, 1)) + 1 }}
        aria-label=${`${one.label}: ${block ? nameOf(block) : "free"}, ${chance} of grasps fail`}
        onClick=${() => onPick(id)}>
        ${block && html`<${Block} ...${block} sizes=${sorting.sizes} />`}
        <small aria-hidden="true">${chance}</small></button>`;
    })}
  </div>`;
}

function Legend({ failure }) {
  const most = Math.max(0.1, ...failure);
  return html`<p class="map-legend"><span>Grasps fail: never</span>
    <i style=${{ background: failureGradient(most) }}></i>
    <span>${percent(most, 0)}</span><span class="spacer"></span>
    <span>robot at bottom</span></p>`;
}

/** What can be done with the block that was picked. */
function Picked({ block, slots, cell, sorting, send, onPick }) {
  const free = slots.filter((one) => !blockIn(sorting, one.id));
  const towers = cell.stations.filter((one) => one.kind === "cluster" && one.id !== block.place);
  const places = [...free, ...towers];
  const name = nameOf(block);
  const inClutter = slots.some((one) => one.id === block.place);
  const leave = () => { // the focus returns to the button that picked the block
    const picker = document.querySelector(`[data-block="${block.id}"]`);
    (picker ?? document.getElementById("blocks-title")).focus();
    onPick(null);
  };
  return html`<div class="picked" role="group" aria-label=${`The ${name}`} data-picked=${block.id}>
    <span class="picked-name"><${Block} ...${block} sizes=${sorting.sizes} />
      <span><b>${capital(name)}</b>
      <small>${block.held ? "at" : inClutter ? "in" : "on the"} ${placeName(cell, block.place)}${
        block.in_goal ? ", in the goal" : ""}</small></span></span>
    <span class="picked-acts">
      <button type="button" class="tool" data-action="toggle-goal"
        onClick=${() => send({ tag: "toggle-goal", id: block.id })}>
        ${block.in_goal ? "Out of the goal" : "Into the goal"}</button>
      <select value="" data-role="move-to" aria-label=${`Move the ${name} to`}
        disabled=${block.held || places.length === 0}
        title=${block.held ? "The robot holds it" : "Put it into a free slot or onto a tower"}
        onChange=${(event) => {
          send({ tag: "move-block", id: block.id, to: event.target.value });
          event.target.value = "";
        }}>
        <option value="" disabled>Move to …</option>
        ${places.map((one) => html`<option key=${one.id} value=${one.id}>
          ${capital(placeName(cell, one.id))}</option>`)}
      </select>
      <button type="button" class="tool" data-action="remove-block"
        onClick=${() => {
          send({ tag: "remove-block", id: block.id });
          leave();
        }}>Remove</button>
      <button type="button" class="text-button" onClick=${leave}>Done</button>
    </span>
  </div>`;
}

/** One of every kind, to be put into the picked free slot, or into any. */
function Shelf({ sorting, at, slots, send }) {
  const full = sorting.blocks.length >= slots.length;
  const reason = `There is room for ${count(slots.length, "block")} at most`;
  return html`<div class="shelf" role="group" aria-labelledby="shelf-title">
    <span id="shelf-title">${full ? `${reason}.` : `Add to ${at ? at.label : "any free slot"}`}</span>
    <div class="shelf-kinds">
      ${sorting.colours.map((colour) => html`<span key=${colour} class="shelf-colour">
        ${sorting.sizes.map((size) => html`<button type="button" key=${size} class="block-button"
          data-add=${kindOf({ colour, size })} disabled=${full}
          title=${full ? reason : `Add a ${nameOf({ colour, size })}`}
          aria-label=${full ? reason : `Add a ${nameOf({ colour, size })} to ${at ? at.label : "any free slot"}`}
          onClick=${() => send({ tag: "add-block", colour, size, at: at?.id ?? null })}>
          <${Block} colour=${colour} size=${size} sizes=${sorting.sizes} /></button>`)}</span>`)}
    </div>
  </div>`;
}

const place = (station, axis) => Math.round(station.position[axis] * 1000);

function places(slots, axis) {
  return [...new Set(slots.map((one) => place(one, axis)))].sort((a, b) => a - b);
}
