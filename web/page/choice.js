// A choice of one: a radio group with one tab stop, whose arrow keys move and choose (WAI-ARIA).
import { html } from "./vendor/htm-preact-standalone.module.js";
import { Icon } from "./icons.js";

const STEPS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** `items` are [value, label, title, icon?]; `mark` gives a button's data attributes; its name is
 * `label`, or the text of the element `labelledby`. */
export function Segmented({ label, labelledby, value, items, onPick, mark }) {
  const at = items.findIndex(([one]) => one === value);
  const move = (event) => {
    const to = next(event.key, event.currentTarget, items.length);
    if (to === null) return;
    event.preventDefault();
    event.currentTarget.children[to].focus();
    onPick(items[to][0]);
  };
  return html`<div class="segmented" role="radiogroup" aria-label=${label} aria-labelledby=${labelledby}
    onKeyDown=${move}>
    ${items.map(([one, text, title, icon], i) => html`<button key=${String(one)} type="button"
      role="radio" aria-checked=${String(i === at)} tabindex=${i === Math.max(at, 0) ? 0 : -1}
      title=${title} ...${mark(one)} onClick=${() => onPick(one)}>
      ${icon && html`<${Icon} name=${icon} />`}${text}</button>`)}
  </div>`;
}

/** The data attribute of a choice's buttons, such as `data-choice="safety:off"`. */
export function marked(name) {
  return (one) => ({ "data-choice": `${name}:${one}` });
}

/** Index of the button that a key moves to from the one that has the focus, or null. */
function next(key, group, n) {
  if (key === "Home") return 0;
  if (key === "End") return n - 1;
  const from = [...group.children].indexOf(document.activeElement);
  return key in STEPS && from >= 0 ? (from + STEPS[key] + n) % n : null;
}
