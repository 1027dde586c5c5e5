// A report: its page, and the evaluations that measure it again.
import { html } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";
import { useAnswer } from "./formfields.js";
import { isActive, JobFrame } from "./jobactions.js";

export function ReportDetail({ job, ...rest }) {
  // The evaluations, oldest first, asked for again whenever the list of jobs was.
  const path = `v1/jobs?part_of=${job.id}&limit=200`;
  const { answer, error } = useAnswer(path, isActive(job) ? job : job.state);
  const parts = answer?.items.toReversed();
  const result = job.state === "succeeded" && job.result;
  const actions = result && html`<a class="tool" data-action="open-report" target="_blank" rel="noopener"
    href=${`v1/jobs/${job.id}/report`}>Open the report</a>`;
  return html`<${JobFrame} ...${{ job, error, actions, ...rest }}>
    ${isActive(job) && !job.spec.measure && html`<p class="empty">The page is written in a moment.</p>`}
    ${isActive(job) && job.spec.measure && parts?.length === 0 && html`<p class="empty">The first
      evaluation is queued in a moment.</p>`}
    ${result && html`<p data-role="report">${result.measured
      ? `${format.count(result.measured, "result")} measured again` : "From stored results"}${
      result.missing.length ? `; ${format.count(result.missing.length, "number")} not measured` : ""}${
      result.failed.length ? `; without a result: ${result.failed.join(", ")}` : ""}.</p>`}
    ${parts?.length > 0 && html`<div class="scrolled"><table class="trials" data-role="parts">
      <thead><tr><th scope="col">Evaluation</th><th scope="col">State</th></tr></thead>
      <tbody>${parts.map((one) => html`<tr key=${one.id}>
        <th scope="row"><button type="button" class="quiet-button" title=${`Show job ${one.number}`}
          onClick=${() => rest.onOpen(one.id)}>${one.spec.protocol}, ${one.spec.checkpoint}</button></th>
        <td title=${one.error ?? ""}>${one.state}</td></tr>`)}</tbody></table></div>`}
  </${JobFrame}>`;
}
