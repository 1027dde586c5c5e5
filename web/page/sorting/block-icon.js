// A block as the page draws it and names it, and the places it can be in.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { BLOCK_INK, BLOCKS } from "../palette.js";

const LETTERS = { tiny: "XS", small: "S", medium: "M", large: "L", huge: "XL" };
const NARROWEST = 0.46;

export const kindOf = ({ colour, size }) => `${colour}-${size}`;
export const nameOf = ({ colour, size }) => `${size} ${colour} block`;

/** "Slot 3", "red tower", "the gripper". */
export function placeName(cell, id) {
  if (id === "held") return "the gripper";
  const station = cell?.stations.find((one) => one.id === id);
  if (station?.kind === "cluster") return `${station.colour} tower`;
  return station?.label ?? id;
}

/** The look of a block: wider is larger; `wanted` ones are only outlined. */
export function Block({ colour, size, sizes, wanted = false }) {
  const share = NARROWEST + (1 - NARROWEST) * ((sizes.indexOf(size) + 1) / sizes.length);
  return html`<span class=${wanted ? "block is-wanted" : "block"} aria-hidden="true"
    style=${{ "--block": BLOCKS[colour], "--block-ink": BLOCK_INK[colour], "--share": share }}>
    ${LETTERS[size] ?? size}</span>`;
}
