// What can be done with a job: cancel, resume, retry, clone, delete, name, notes, priority.
import { html, useEffect, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { patch, post, remove } from "../api.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";
import { BUDGETS, budgetBody, budgetTexts } from "./budgets.js";
import { parsed, useForm } from "./formfields.js";

const FINAL = new Set(["succeeded", "failed", "cancelled"]);
const LABELS = [
  { name: "name", type: "text", default: "", help: "For the list of jobs; may be empty." },
  { name: "priority", default: 0, help: "Waiting jobs of a higher priority start first",
    minimum: -100, maximum: 100 },
];
const COMPOSED = new Set(["sweep", "report"]); // resumed from their parts
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
    ${repeatable && (job.resume_step !== null || COMPOSED.has(job.kind)) && html`<button type="button" class="tool"
      data-action="resume" disabled=${again.busy} onClick=${() => act("resume")}
      title="Continue this job from its last state">
      ${COMPOSED.has(job.kind) ? "Resume" : `Resume at ${format.steps(job.resume_step)} steps`}</button>`}
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
  const box = useRef(null);
  const turned = useRef(false);
  const turn = (to) => {
    turned.current = true;
    setAsking(to);
  };
  // The button that had the focus is gone: it goes to the one that changes nothing.
  useEffect(() => {
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

/** Name, priority, budgets and notes of a job, changed together. */
export function Labels({ job, onChanged }) {
  const shown = { name: job.name ?? "", notes: job.notes ?? "", priority: String(job.priority),
    ...budgetTexts(job) };
  const fields = job.kind === "train" && job.state !== "succeeded" ? [...LABELS, ...BUDGETS] : LABELS;
  const form = useForm({
    names: ["notes", ...fields.map((field) => field.name)], prefix: "label",
    onDone: () => {
      form.start({});
      onChanged();
    },
  });
  const values = { ...shown, ...form.typed };
  const changed = Object.keys(form.typed).filter((name) => values[name] !== shown[name]);
  const save = () => {
    const body = { ...values, ...budgetBody(values), priority: parsed(values.priority.replace("\u2212", "-")) };
    return patch(`v1/jobs/${job.id}`, Object.fromEntries(changed.map((name) => [name, body[name]])));
  };
  return html`<details class="more labels" data-role="labels">
    <summary><${Icon} name="chevron" />Name, priority${fields === LABELS ? "" : ", budgets"} and notes</summary>
    <form class="train" ref=${form.ref} onSubmit=${form.submit(save)} noValidate>
      ${fields.map((field) => form.row(field, values))}
      <label class="sr" for="label-notes">Notes</label>
      <textarea id="label-notes" rows="3" maxlength="4000" placeholder="Notes" value=${values.notes}
        onInput=${(event) => form.type("notes", event.target.value)}></textarea>
      <div class="train-foot"><button type="submit" class="tool" data-action="save-labels"
        disabled=${form.busy || changed.length === 0}>Save</button>
        ${["", "notes"].map((name) => form.faults[name] && html`<span class="field-error" key=${name}
          role="alert">${form.faults[name]}</span>`)}</div>
    </form>
  </details>`;
}
