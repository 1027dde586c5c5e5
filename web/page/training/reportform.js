// The form that starts a report: from stored results, or measured again.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { post } from "../api.js";
import { FormHead, OWN, parsed, useForm } from "./formfields.js";

const MEASURE = { name: "measure", title: "Results", default: "false", choices: ["false", "true"],
  labels: { false: "stored", true: "measure again" },
  help: "Stored results take seconds; all evaluations take hours" };
const MEASURED = [
  { name: "episodes", default: "", minimum: 1,
    help: "Of each evaluation; empty for its own number" },
  { name: "parallel", title: "Parallel evaluations", default: 1, minimum: 1, maximum: 8,
    help: "Queued or run at once" },
  { ...OWN[0], default: 11 },
];

export function ReportForm({ onStarted, onClose }) {
  const form = useForm({
    names: [...MEASURED, MEASURE, OWN[1]].map(({ name }) => name), prefix: "report",
    onDone: onStarted,
  });
  const value = ({ name, default: own }) => form.typed[name] ?? String(own);
  const measure = value(MEASURE) === "true";
  const [episodes, parallel, seed] = MEASURED.map(value);
  const send = (key) => post("v1/jobs", {
    kind: "report", measure, name: value(OWN[1]) || null,
    ...(measure && { episodes: episodes.trim() ? parsed(episodes) : null,
      parallel: parsed(parallel), seed: parsed(seed) }),
  }, key);
  return html`<form class="train" ref=${form.ref} onSubmit=${form.submit(send)} noValidate
    aria-label="New report">
    <${FormHead} title="New report" fault=${form.faults[""]} onClose=${onClose} />
    <p class="field-help">Every table and figure of the thesis beside the results of Tandem.</p>
    ${[MEASURE, ...(measure ? MEASURED : []), OWN[1]].map((field) => form.row(field))}
    <div class="train-foot">
      <button type="submit" class="primary" disabled=${form.busy}>
        ${form.busy ? "Starting …" : "Start report"}</button>
      ${measure && html`<span class="faint">Its evaluations wait in the queue like others.</span>`}
    </div>
  </form>`;
}
