// The form that starts a report: from stored results, or measured again.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { post } from "../api.js";
import { OWN, parsed, StartForm, useForm } from "./formfields.js";

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
  return html`<${StartForm} form=${form} title="New report" send=${send} start="Start report"
    note=${measure && "Its evaluations wait in the queue like others."} onClose=${onClose}>
    <p class="field-help">Every table and figure of the thesis beside the results of Tandem.</p>
    ${[MEASURE, ...(measure ? MEASURED : []), OWN[1]].map((field) => form.row(field))}
  </${StartForm}>`;
}
