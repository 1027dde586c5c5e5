// Budgets of a job: steps and run time after which it ends and can be resumed.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { post } from "../api.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";
import { parsed, useForm } from "./formfields.js";

const MINUTE = 60;

export const BUDGETS = [
  { name: "step_budget", title: "Step budget", unit: "env steps", default: "",
    help: "It ends at the first point of its curve beyond and can be resumed; empty for none" },
  { name: "time_budget_s", title: "Time budget", unit: "min", default: "",
    help: "Run time, without waiting in the queue; it can be resumed; empty for none. 1 s to 366 days" },
];

/** The budgets of a job as texts of a form. */
export function budgetTexts(job) {
  return {
    step_budget: job?.step_budget ? format.grouped(job.step_budget) : "",
    time_budget_s: job?.time_budget_s ? String(job.time_budget_s / MINUTE) : "",
  };
}

/** The budgets of texts as members of a body; an empty text is none. */
export function budgetBody(texts) {
  const value = (name) => (texts[name]?.trim() ? parsed(texts[name]) : null);
  const minutes = value("time_budget_s");
  return {
    step_budget: value("step_budget"),
    time_budget_s: typeof minutes === "number" ? minutes * MINUTE : minutes,
  };
}

/** What a budget did to a job, and the form that resumes it with a larger one. */
export function EndedByBudget({ job, onChanged }) {
  const form = useForm({
    typed: budgetTexts(job), names: BUDGETS.map(({ name }) => name), prefix: "resume",
    onDone: onChanged,
  });
  const send = () => post(`v1/jobs/${job.id}/resume`, budgetBody(form.typed));
  return html`<div data-role="ended-by">
    <p class="notice warn" role="status"><${Icon} name="alert" />
      <span><b>Ended by its ${job.ended_by}</b> at ${job.total_steps
        ? `${format.steps(job.step)} of ${format.count(job.total_steps, "step")}`
        : format.count(job.step, "step")} after ${format.duration(job.run_s)}.
      ${job.resume_step === null ? " Its state is not kept any more: clone it to train longer." : ` It continues from
      ${format.count(job.resume_step, "step")} with a larger budget.`}</span></p>
    ${job.resume_step !== null && html`<form class="train" ref=${form.ref} noValidate
      onSubmit=${form.submit(send)} aria-label=${`Resume job ${job.number}`}>
      ${form.faults[""] && html`<p class="field-error" role="alert">${form.faults[""]}</p>`}
      ${BUDGETS.map((field) => form.row(field))}
      <div class="train-foot"><button type="submit" class="primary" data-action="resume-budget"
        disabled=${form.busy}>Resume</button></div>
    </form>`}</div>`;
}
