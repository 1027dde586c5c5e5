// Requests that a click starts: one at a time, with a question before those that remove something.
import { sentence } from "./format.js";
import { html, useLayoutEffect, useRef, useState } from "./vendor/htm-preact-standalone.module.js";

/** One request at a time, however often its button is clicked; its error stays until the next, or `forget`. */
export function useAction(onDone) {
  const [state, setState] = useState({ busy: false, error: null });
  const running = useRef(false);
  const run = async (act) => {
    if (running.current) return;
    running.current = true;
    setState({ busy: true, error: null });
    let error = null;
    try {
      onDone?.(await act());
    } catch (problem) {
      error = problem;
    }
    running.current = false;
    setState({ busy: false, error });
  };
  const forget = () => setState({ busy: false, error: null });
  return { ...state, run, forget };
}

export function Fault({ error }) {
  return error && html`<span class="field-error" role="alert">${sentence(error.message)}</span>`;
}

/** A button that asks before it acts. */
export function Ask({ name, label, question, yes, no, action, onYes }) {
  const [asking, setAsking] = useState(false);
  const box = useRef(null);
  const turned = useRef(false);
  const turn = (to) => {
    turned.current = true;
    setAsking(to);
  };
  // The button that had the focus is gone: it goes to the one that changes nothing.
  useLayoutEffect(() => {
    if (turned.current) box.current.querySelector("button:last-of-type").focus();
  }, [asking]);
  return html`<div class="confirm" ref=${box}
    onKeyDown=${(event) => asking && event.key === "Escape" && turn(false)}>
    ${asking
      ? html`<span>${question}</span>
          <button type="button" class="danger" data-action=${`${name}-yes`} disabled=${action.busy}
            onClick=${() => action.run(onYes)}>${yes}</button>
          <button type="button" class="tool" onClick=${() => turn(false)}>${no}</button>`
      : html`<button type="button" class="tool" data-action=${name}
          onClick=${() => turn(true)}>${label}</button>`}
    <${Fault} error=${action.error} />
  </div>`;
}
