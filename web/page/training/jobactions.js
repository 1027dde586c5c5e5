// What can be done with a job: cancel, resume, retry, clone, delete, name, notes, priority.
import { html, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { patch, post, remove } from "../api.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";

const FINAL = new Set(["succeeded", "failed", "cancelled"]);
const REPEATABLE = new Set(["failed", "cancelled"]);

export function isActive(job) {
  return !FINAL.has(job.state);
}

/** One request at a time, however often its button is clicked; its error stays until the next. */
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
  return { ...state, run };
}

export function Fault({ error }) {
  return error && html`<span class="field-error" role="alert">${error.message}</span>`;
}

/** Buttons of a job; `onOpen` shows a job, `onClone` opens the form with its values. */
export function JobActions({ job, onChanged, onOpen, onClone }) {
  const again = useAction((made) => {
    onChanged();
    onOpen(made.id);
  });
  const repeatable = REPEATABLE.has(job.state);
  const act = (name) => again.run(() => post(`v1/jobs/${job.id}/${name}`));
  return html`
    ${repeatable && job.resume_step !== null && html`<button type="button" class="tool"
      data-action="resume" disabled=${again.busy} onClick=${() => act("resume")}
      title="Continue this job from its last state">
      Resume at ${format.steps(job.resume_step)} steps</button>`}
    ${repeatable && html`<button type="button" class="tool" data-action="retry"
      disabled=${again.busy} onClick=${() => act("retry")}
      title="Run a new job with the same values from its start">Retry</button>`}
    ${job.kind === "train" && html`<button type="button" class="tool" data-action="clone"
      onClick=${() => onClone(job)} title="Start a job like this one, with changes">Clone …</button>`}
    ${FINAL.has(job.state) && html`<${Delete} job=${job} onChanged=${onChanged} />`}
    ${isActive(job) && html`<${Cancel} job=${job} onChanged=${onChanged} />`}
    <${Fault} error=${again.error} />`;
}

function Cancel({ job, onChanged }) {
  const cancelling = useAction(onChanged);
  if (job.state === "cancelling") return html`<span class="faint">Stopping …</span>`;
  return html`<${Ask} name="cancel" label="Cancel …" question="Cancel it? Its checkpoints stay."
    yes="Cancel the job" no="Keep going" action=${cancelling}
    onYes=${() => post(`v1/jobs/${job.id}/cancel`)} />`;
}

function Delete({ job, onChanged }) {
  return html`<${Ask} name="delete" label="Delete …" yes="Delete the job" no="Keep it"
    question="Delete it? Its curve and its checkpoints go with it." action=${useAction(onChanged)}
    onYes=${() => remove(`v1/jobs/${job.id}`)} />`;
}

/** A button that asks before it acts. */
export function Ask({ name, label, question, yes, no, action, onYes }) {
  const [asking, setAsking] = useState(false);
  return html`<div class="confirm">
    ${asking
      ? html`<span>${question}</span>
          <button type="button" class="danger" data-action=${`${name}-yes`} disabled=${action.busy}
            onClick=${() => action.run(onYes)}>${yes}</button>
          <button type="button" class="tool" onClick=${() => setAsking(false)}>${no}</button>`
      : html`<button type="button" class="tool" data-action=${name}
          onClick=${() => setAsking(true)}>${label}</button>`}
    <${Fault} error=${action.error} />
  </div>`;
}

/** Name, priority and notes of a job, changed together. */
export function Labels({ job, onChanged }) {
  const [typed, setTyped] = useState({});
  const saving = useAction(() => {
    setTyped({});
    onChanged();
  });
  const shown = { name: job.name ?? "", notes: job.notes ?? "", priority: String(job.priority), ...typed };
  const changed = Object.keys(typed).some((key) => typed[key] !== String(job[key] ?? ""));
  const set = (key) => (event) => setTyped((now) => ({ ...now, [key]: event.target.value }));
  const fault = (key) => saving.error?.field === key;
  const save = (event) => {
    event.preventDefault();
    const body = { ...typed };
    if ("priority" in body) body.priority = number(body.priority);
    saving.run(() => patch(`v1/jobs/${job.id}`, body));
  };
  const input = (key, label, more) => html`<div class="field">
    <label for=${`label-${key}`}>${label}</label>
    <input id=${`label-${key}`} type="text" autocomplete="off" value=${shown[key]} ...${more}
      aria-invalid=${String(fault(key))} onInput=${set(key)} /></div>`;
  return html`<details class="more labels" data-role="labels">
    <summary><${Icon} name="chevron" />Name, priority and notes</summary>
    <form class="train" onSubmit=${save} noValidate>
      ${input("name", "Name", { maxlength: 80, placeholder: "none" })}
      ${input("priority", "Priority", { inputmode: "numeric" })}
      <p class="field-help">Waiting jobs of a higher priority start first: −100 to 100.</p>
      <label class="sr" for="label-notes">Notes</label>
      <textarea id="label-notes" rows="3" maxlength="4000" placeholder="Notes" value=${shown.notes}
        onInput=${set("notes")}></textarea>
      <div class="train-foot"><button type="submit" class="tool" data-action="save-labels"
        disabled=${saving.busy || !changed}>Save</button>
        <${Fault} error=${saving.error} /></div>
    </form>
  </details>`;
}

/** Text as a number where it is one; the service says what it thinks of the rest. */
function number(text) {
  const plain = String(text).trim().replace("\u2212", "-");
  return plain !== "" && Number.isFinite(Number(plain)) ? Number(plain) : text;
}
