// What a visitor can do to the cell: the people, the clock, the goals, the cases.
import { html, useState } from "./vendor/htm-preact-standalone.module.js";
import { Icon } from "./icons.js";
import { People } from "./people.js";

export function Controls({ world, cell, cases, send, colourOf, labelOf }) {
  return html`<section class="dock" aria-label="Controls of the cell">
    <${People} world=${world} send=${send}>
      <div class="transport" role="group" aria-label="Clock">
        <button type="button" class="tool" onClick=${() =>
          send({ tag: world.paused ? "resume" : "pause" })} data-action="pause"
          aria-label=${world.paused ? "Resume" : "Pause"}>
          <${Icon} name=${world.paused ? "play" : "pause"} filled=${world.paused} />
          <span>${world.paused ? "Resume" : "Pause"}</span></button>
        <button type="button" class="tool" disabled=${!world.paused} data-action="step"
          aria-label="Step"
          title=${world.paused ? "One decision, 0.05 s" : "Pause first"}
          onClick=${() => send({ tag: "step" })}><${Icon} name="step" /><span>Step</span></button>
        <button type="button" class="tool" data-action="reset" aria-label="Reset"
          onClick=${() => send({ tag: "reset" })}><${Icon} name="reset" /><span>Reset</span></button>
      </div>
    </${People}>
    <div class="dock-row">
      <span class="dock-label" id="goals-label">Goals</span>
      <${Goals} world=${world} cell=${cell} send=${send} colourOf=${colourOf} labelOf=${labelOf} />
    </div>
    ${cases.length > 0 && html`<${Cases} cases=${cases} running=${world.case} send=${send} />`}
  </section>`;
}

/** The case studies by title; what happens in one is told when it is pointed at or runs. */
function Cases({ cases, running, send }) {
  const [pointed, setPointed] = useState(null);
  const told = cases.find((c) => c.id === (pointed ?? running));
  const point = (id) => ({
    onMouseEnter: () => setPointed(id),
    onMouseLeave: () => setPointed(null),
    onFocus: () => setPointed(id),
    onBlur: () => setPointed(null),
  });
  return html`<div class="dock-row dock-cases">
    <span class="dock-label" id="cases-label">Cases</span>
    <div>
      <div class="cases" role="group" aria-labelledby="cases-label">
        ${cases.map((c, i) => html`<button key=${c.id} type="button" class="case"
          aria-pressed=${String(running === c.id)} aria-description=${c.text} data-case=${c.id}
          ...${point(c.id)} onClick=${() => send({ tag: "start-case", id: c.id })}>
          <b>${i + 1}</b><span>${c.title}</span></button>`)}
      </div>
      <p class="case-text">${told ? told.text
        : "Four situations of the study: the person reaches in, the robot picks the better goal."}</p>
    </div>
  </div>`;
}

function Goals({ world, cell, send, colourOf, labelOf }) {
  const active = new Set(world.selected ?? world.candidates.map((c) => c.id));
  return html`<div class="goals" role="group" aria-labelledby="goals-label">
    ${(cell?.stations ?? []).map(({ id }) => {
      const on = active.has(id);
      return html`<button key=${id} type="button" class="goal" aria-pressed=${String(on)}
        data-goal=${id} onClick=${() => send({ tag: "toggle-candidate", id })}>
        <i class="swatch" style=${on ? { background: colourOf(id) } : {}}></i>
        ${labelOf(id)}</button>`;
    })}
  </div>`;
}
