// A report: its page, and the evaluations that measure it again.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { get } from "../api.js";
import { Icon } from "../icons.js";
import { JobActions, Labels, isActive } from "./jobactions.js";

export function ReportDetail({ job, onChanged, onOpen, onClone }) {
  const { parts, error } = useParts(job);
  const result = job.state === "succeeded" && job.result;
  return html`<div class="job-detail">
    ${(job.error || error) && html`<p class="notice bad" role="alert"><${Icon} name="alert" />
      <span>${job.error ?? error.message}</span></p>`}
    ${isActive(job) && !job.spec.measure && html`<p class="empty">The page is written in a moment.</p>`}
    ${isActive(job) && job.spec.measure && parts?.length === 0 && html`<p class="empty">The first
      evaluation is queued in a moment.</p>`}
    ${result && html`<p data-role="report">${result.measured
      ? `${result.measured} results measured again` : "From stored results"}${
      result.missing.length ? `; ${result.missing.length} numbers are not measured` : ""}${
      result.failed.length ? `; without a result: ${result.failed.join(", ")}` : ""}.</p>`}
    ${parts?.length > 0 && html`<div class="scrolled"><table class="trials" data-role="parts">
      <thead><tr><th scope="col">Evaluation</th><th scope="col">State</th></tr></thead>
      <tbody>${parts.map((one) => html`<tr key=${one.id}>
        <th scope="row"><button type="button" class="quiet-button" title=${`Show job ${one.number}`}
          onClick=${() => onOpen(one.id)}>${one.spec.protocol}, ${one.spec.checkpoint}</button></th>
        <td title=${one.error ?? ""}>${one.state}</td></tr>`)}</tbody></table></div>`}
    ${job.notes && html`<p class="notes" data-role="notes">${job.notes}</p>`}
    <div class="job-actions">
      ${result && html`<a class="tool" data-action="open-report" target="_blank" rel="noopener"
        href=${`v1/jobs/${job.id}/report`}>Open the report</a>`}
      <${JobActions} ...${{ job, onChanged, onOpen, onClone }} /></div>
    <${Labels} job=${job} onChanged=${onChanged} />
  </div>`;
}

/** The evaluations of a report, oldest first, asked for again whenever the list of jobs was. */
function useParts(job) {
  const [state, setState] = useState({ parts: null, error: null });
  useEffect(() => {
    const stop = new AbortController();
    get(`v1/jobs?part_of=${job.id}&limit=200`, { signal: stop.signal }).then(
      (page) => setState({ parts: page.items.reverse(), error: null }),
      (error) => error.name !== "AbortError" && setState((now) => ({ ...now, error })));
    return () => stop.abort();
  }, [job.id, isActive(job) ? job : job.state]);
  return state;
}
