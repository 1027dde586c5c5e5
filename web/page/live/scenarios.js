// A row of scenarios that start with one click; the description of one is shown on hover.
import { html, useState } from "../vendor/htm-preact-standalone.module.js";

/** `items` with id, title and text; `tag` is the command that starts one. */
export function Scenarios({ label, hint, items, running, tag, send }) {
  const [pointed, setPointed] = useState(null);
  const shown = items.find((one) => one.id === (pointed ?? running));
  const point = (id) => ({
    onMouseEnter: () => setPointed(id),
    onMouseLeave: () => setPointed(null),
    onFocus: () => setPointed(id),
    onBlur: () => setPointed(null),
  });
  return html`<div class="dock-row dock-cases">
    <span class="dock-label" id="cases-label">${label}</span>
    <div>
      <div class="cases" data-count=${items.length} role="group" aria-labelledby="cases-label">
        ${items.map((one, i) => html`<button key=${one.id} type="button" class="case"
          aria-pressed=${String(running === one.id)} aria-description=${one.text}
          data-case=${one.id} ...${point(one.id)} onClick=${() => send({ tag, id: one.id })}>
          <b>${i + 1}</b><span title=${one.title}>${one.title}</span></button>`)}
      </div>
      <p class="case-text">${shown ? shown.text : hint}</p>
    </div>
  </div>`;
}
