// What every open job shows, around what its kind shows.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { sentence } from "../format.js";
import { Alert } from "../icons.js";
import { JobActions, Labels } from "./jobactions.js";

const RUN_KINDS = new Set(["train", "evaluate"]); // with a worker; others are made of jobs

/** Its fault, the children, its notes, `actions` beside those of any job, and its labels. */
export function JobFrame({ job, error, actions, children, onChanged, onOpen, onClone }) {
  const fault = job.error ?? error?.message;
  return html`<div class="job-detail">
    ${fault && html`<${Alert}>${sentence(fault)}</${Alert}>`}
    ${children}
    ${job.notes && html`<p class="notes" data-role="notes">${job.notes}</p>`}
    <div class="job-actions">${actions}
      ${RUN_KINDS.has(job.kind) && html`<a class="tool" data-action="log" target="_blank" rel="noopener"
        href=${`v1/jobs/${job.id}/log`}>Output</a>`}
      <${JobActions} ...${{ job, onChanged, onOpen, onClone }} /></div>
    <${Labels} job=${job} onChanged=${onChanged} />
  </div>`;
}
