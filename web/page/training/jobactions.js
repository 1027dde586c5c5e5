// What every open job shows, and what can be done with it: cancel, resume, retry, clone, delete, name, notes,
// priority.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { Ask, Fault, useAction } from "../action.js";
import { patch, post, remove } from "../api.js";
import * as format from "../format.js";
import { Alert, Icon } from "../icons.js";
import { BUDGETS, budgetBody, budgetTexts } from "./budgets.js";
import { parsed, useForm } from "./formfields.js";

const FINAL = new Set(["succeeded", "failed", "cancelled"]);
const LABELS = [
  { name: "name", type: "text", default: "", help: "For the list of jobs; may be empty." },
  { name: "priority", default: 0, help: "Waiting jobs of a higher priority start first",
    minimum: -100, maximum: 100 },
];
const COMPOSITE_KINDS = new Set(["sweep", "report"]); // made of jobs: no worker, resumed from their parts
const REPEATABLE = new Set(["failed", "cancelled"]);

export function isActive(job) {
  return !FINAL.has(job.state);
}

/** Its fault, the `error` of the request for its parts, the children, its notes, `actions` and labels. */
export function JobFrame({ job, error, actions, children, onChanged, onOpen, onClone }) {
  return html`<div class="job-detail">
    ${job.error && html`<${Alert}>${format.sentence(job.error)}</${Alert}>`}
    ${error && html`<${Alert}>${format.sentence(`Its parts could not be loaded: ${error.message}`)}</${Alert}>`}
    ${children}
    ${job.notes && html`<p class="notes" data-role="notes">${job.notes}</p>`}
    <div class="job-actions">${actions}
      ${!COMPOSITE_KINDS.has(job.kind) && html`<a class="tool" data-action="log" target="_blank" rel="noopener"
        href=${`v1/jobs/${job.id}/log`}>Output</a>`}
      <${JobActions} ...${{ job, onChanged, onOpen, onClone }} /></div>
    <${Labels} job=${job} onChanged=${onChanged} />
  </div>`;
}

/** Buttons of a job; `onOpen` shows a job, `onClone` opens the form with its values. */
function JobActions({ job, onChanged, onOpen, onClone }) {
  const again = useAction((made) => {
    onChanged();
    onOpen(made.id);
  });
  const repeatable = REPEATABLE.has(job.state);
  const resumable = repeatable ? job.resume_step !== null || COMPOSITE_KINDS.has(job.kind)
    : job.ended_by === "failed parts";
  const act = (name) => again.run(() => post(`v1/jobs/${job.id}/${name}`));
  return html`
    ${resumable && html`<button type="button" class="tool"
      data-action="resume" disabled=${again.busy} onClick=${() => act("resume")}
      title="Continue this job from its last state">
      ${COMPOSITE_KINDS.has(job.kind) ? "Resume" : `Resume at ${format.count(job.resume_step, "step")}`}</button>`}
    ${repeatable && html`<button type="button" class="tool" data-action="retry"
      disabled=${again.busy} onClick=${() => act("retry")}
      title="Run a new job with the same values from its start">Retry</button>`}
    ${job.kind === "train" && html`<button type="button" class="tool" data-action="clone"
      onClick=${() => onClone(job)} title="Start a job like this one, with changes">Clone …</button>`}
    ${FINAL.has(job.state) && html`<${Delete} job=${job} onDone=${() => (onOpen(null), onChanged())} />`}
    ${isActive(job) && html`<${Cancel} job=${job} onChanged=${onChanged} />`}
    <${Fault} error=${again.error} />`;
}

/** What goes with a job that is deleted, by its kind. */
function lossOf({ kind, spec }) {
  if (kind === "train") return "Its curve and its checkpoints without an alias go with it.";
  if (kind === "sweep") return "Its trials become jobs of their own.";
  return `Its result goes with it${spec.measure ? "; its evaluations become jobs of their own" : ""}.`;
}

function Cancel({ job, onChanged }) {
  const cancelling = useAction(onChanged);
  if (job.state === "cancelling") return html`<span class="faint">Stopping …</span>`;
  return html`<${Ask} name="cancel" label="Cancel …" yes="Cancel the job" no="Keep going" action=${cancelling}
    question=${job.kind === "train" ? "Cancel it? Its checkpoints stay." : "Cancel it?"}
    onYes=${() => post(`v1/jobs/${job.id}/cancel`)} />`;
}

function Delete({ job, onDone }) {
  return html`<${Ask} name="delete" label="Delete …" yes="Delete the job" no="Keep it"
    question=${`Delete it? ${lossOf(job)}`} action=${useAction(onDone)}
    onYes=${() => remove(`v1/jobs/${job.id}`)} />`;
}

/** Name, priority, budgets and notes of a job, changed together. */
function Labels({ job, onChanged }) {
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
  const changed = ["notes", ...fields.map(({ name }) => name)]
    .filter((name) => name in form.typed && values[name] !== shown[name]);
  const save = () => {
    const body = { ...values, ...budgetBody(values), priority: parsed(values.priority) };
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
