// The blocks that are there: a plan of the clutter on its failure map, from which blocks are
// picked to be moved or taken away, and a shelf from which more are added.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Block, capital, kindOf, nameOf, placeName, plural } from "./block-icon.js";
import { failureColours, failureGradient } from "../palette.js";

export function Blocks({ sorting, cell, send, picked, onPick }) {
  const cells = cell.stations.filter((one) => one.kind === "clutter");
  const held = sorting.pieces.find((one) => one.held);
  const piece = sorting.pieces.find((one) => one.id === picked);
  const at = cells.find((one) => one.id === picked && !inCell(sorting, one.id));
  return html`<section class="card" aria-labelledby="blocks-title">
    <header class="card-head">
      <h2 id="blocks-title">Blocks</h2>
      <span class="faint">${sorting.pieces.length} of at most ${cells.length}</span>
    </header>
    <${Plan} cells=${cells} sorting=${sorting} picked=${picked} onPick=${onPick} />
    <${Legend} failure=${sorting.failure} />
    ${piece
      ? html`<${Picked} key=${piece.id} piece=${piece} cells=${cells} cell=${cell}
          sorting=${sorting} send=${send} onPick=${onPick} />`
      : html`<${Shelf} sorting=${sorting} at=${at} cells=${cells} send=${send} />`}
    ${held && html`<p class="faint" data-role="held">The ${nameOf(held)} is held by the gripper.</p>`}
  </section>`;
}

const inCell = (sorting, id) => sorting.pieces.find((one) => one.place === id && !one.held);

/** The clutter from above, the robot's side below. */
function Plan({ cells, sorting, picked, onPick }) {
  const columns = places(cells, 0);
  const rows = places(cells, 1).reverse();
  return html`<div class="plan" role="group" aria-label="Clutter cells from above"
    style=${{ "--columns": columns.length }}>
    ${cells.map((one, index) => {
      const piece = inCell(sorting, one.id);
      const { background, ink } = failureColours(sorting.failure[index]);
      const chance = `${Math.round(100 * sorting.failure[index])} %`;
      const id = piece?.id ?? one.id;
      return html`<button type="button" key=${one.id} class="plan-cell" data-cell=${one.id}
        data-piece=${piece?.id} aria-pressed=${String(picked === id)}
        style=${{ background, color: ink, gridColumn: columns.indexOf(place(one, 0)) + 1,
          gridRow: rows.indexOf(place(one, 1)) + 1 }}
        aria-label=${`${one.label}: ${piece ? nameOf(piece) : "free"}, ${chance} of grasps fail`}
        onClick=${() => onPick(id)}>
        ${piece && html`<${Block} ...${piece} sizes=${sorting.sizes} />`}
        <small aria-hidden="true">${chance}</small></button>`;
    })}
  </div>`;
}

function Legend({ failure }) {
  const most = Math.max(0.1, ...failure);
  return html`<p class="map-legend"><span>Grasps fail: never</span>
    <i style=${{ background: failureGradient(most) }}></i>
    <span>${Math.round(100 * most)} %</span><span class="spacer"></span>
    <span>robot at bottom</span></p>`;
}

/** What can be done with the block that was picked. */
function Picked({ piece, cells, cell, sorting, send, onPick }) {
  const free = cells.filter((one) => !inCell(sorting, one.id));
  const towers = cell.stations.filter((one) => one.kind === "cluster" && one.id !== piece.place);
  const places = [...free, ...towers];
  const name = nameOf(piece);
  const inClutter = cells.some((one) => one.id === piece.place);
  return html`<div class="picked" role="group" aria-label=${`The ${name}`} data-picked=${piece.id}>
    <span class="picked-name"><${Block} ...${piece} sizes=${sorting.sizes} />
      <span><b>${capital(name)}</b>
      <small>${piece.held ? "at" : inClutter ? "in" : "on the"} ${placeName(cell, piece.place)}${
        piece.in_goal ? ", in the goal" : ""}</small></span></span>
    <span class="picked-acts">
      <button type="button" class="tool" data-action="toggle-goal"
        onClick=${() => send({ tag: "toggle-goal", id: piece.id })}>
        ${piece.in_goal ? "Out of the goal" : "Into the goal"}</button>
      <select value="" data-role="move-to" aria-label=${`Move the ${name} to`}
        disabled=${piece.held || places.length === 0}
        title=${piece.held ? "The robot holds it" : ""}
        onChange=${(event) => {
          send({ tag: "move-object", id: piece.id, to: event.target.value });
          event.target.value = "";
        }}>
        <option value="" disabled>Move to …</option>
        ${places.map((one) => html`<option key=${one.id} value=${one.id}>
          ${capital(placeName(cell, one.id))}</option>`)}
      </select>
      <button type="button" class="tool" data-action="remove-object"
        onClick=${() => {
          send({ tag: "remove-object", id: piece.id });
          onPick(null);
        }}>Remove</button>
      <button type="button" class="text-button" onClick=${() => onPick(null)}>Done</button>
    </span>
  </div>`;
}

/** One of every kind, to be put into the picked free cell, or into any. */
function Shelf({ sorting, at, cells, send }) {
  const full = sorting.pieces.length >= cells.length;
  const reason = `There is room for ${plural(cells.length, "block")} at most`;
  return html`<div class="shelf" role="group" aria-labelledby="shelf-title">
    <span id="shelf-title">${full ? `${reason}.` : `Add to ${at ? at.label : "any free cell"}`}</span>
    <div class="shelf-kinds">
      ${sorting.colours.map((colour) => html`<span key=${colour} class="shelf-colour">
        ${sorting.sizes.map((size) => html`<button type="button" key=${size} class="block-button"
          data-add=${kindOf({ colour, size })} disabled=${full}
          title=${full ? reason : `Add a ${nameOf({ colour, size })}`}
          aria-label=${full ? reason : `Add a ${nameOf({ colour, size })} to ${at ? at.label : "any free cell"}`}
          onClick=${() => send({ tag: "add-object", colour, size, at: at?.id ?? null })}>
          <${Block} colour=${colour} size=${size} sizes=${sorting.sizes} /></button>`)}</span>`)}
    </div>
  </div>`;
}

const place = (station, axis) => Math.round(station.position[axis] * 1000);

function places(cells, axis) {
  return [...new Set(cells.map((one) => place(one, axis)))].sort((a, b) => a - b);
}
