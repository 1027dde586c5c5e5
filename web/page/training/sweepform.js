// The form that starts a sweep: drawn fields with their ranges, trials and objective.
import { html, useState } from "../vendor/htm-preact-standalone.module.js";
import { post } from "../api.js";
import { Close, Icon } from "../icons.js";
import { byGroup, presetFor, shownCell } from "./fieldnames.js";
import { Loading, OWN, parsed, presetField, protocolField, StartForm, useForm } from "./formfields.js";

const MAX_RANGES = 8;
const FIRST_RANGE = { id: 0, path: "learning.lr_start" }; // rows keep their id when their field changes
const COUNTS = [
  { name: "trials", title: "Trials", default: 20, minimum: 2, maximum: 200,
    help: "Trainings with drawn fields, each evaluated" },
  { name: "parallel", title: "Parallel trials", default: 1, minimum: 1, maximum: 8,
    help: "Queued or run at once" },
];
const QUANTITY = { name: "objective.quantity", title: "Objective", default: "success",
  labels: { success: "most success", collision: "least collision",
    timeout: "least timeout" } };
const EPISODES = { name: "objective.episodes", title: "Episodes", default: "",
  help: "Of each evaluation; empty for its own number" };
const PRUNE = { name: "prune", title: "Pruning", default: "true", choices: ["true", "false"],
  labels: { true: "median rule", false: "none" },
  help: "Stops trainings that are below the median of those before" };

export function SweepForm({ protocols, presets: { items: presets, error }, cell, onStarted, onClose }) {
  const [name, setName] = useState(null);
  const [ranges, setRanges] = useState([FIRST_RANGE]);
  const preset = presetFor(presets, name, cell);
  const total = preset?.fields.find((f) => f.name === "learning.total_steps");
  const own = [...OWN, ...COUNTS, QUANTITY, EPISODES, PRUNE].map((f) => f.name);
  const form = useForm({
    names: ["preset", "objective.protocol", "learning.total_steps", ...own,
      ...ranges.map(({ path }) => `ranges.${path}`), "ranges"],
    prefix: "sweep", onDone: onStarted,
  });
  if (!preset) return html`<${Loading} what="presets" error=${error} onClose=${onClose} />`;
  const value = (field) => form.typed[field.name] ?? String(field.default);
  const send = (key) => post("v1/jobs", {
    kind: "sweep", preset: preset.name, seed: parsed(value(OWN[0])), name: value(OWN[1]) || null,
    overrides: { ...shownCell(preset, cell), learning: { total_steps: parsed(value(total)) } },
    ranges: Object.fromEntries(ranges.map((one) => [one.path, rangeOf(one, preset)])),
    trials: parsed(value(COUNTS[0])), parallel: parsed(value(COUNTS[1])),
    prune: value(PRUNE) === "true",
    objective: {
      protocol: form.typed["objective.protocol"] ?? preset.objectives[0],
      quantity: value(QUANTITY), episodes: value(EPISODES).trim() ? parsed(value(EPISODES)) : null,
    },
  }, key);
  const change = (place, more) => {
    form.type(`ranges.${ranges[place].path}`, "");
    setRanges((now) => now.map((one, k) => (k === place ? { ...one, ...more } : one)));
  };
  const drawable = preset.fields.filter(({ name: path }) => !["cell", total.name].includes(path));
  const free = drawable.filter((f) => !ranges.some((r) => r.path === f.name));
  return html`<${StartForm} form=${form} title="New sweep" send=${send} start="Start sweep"
    note="Its trainings wait in the queue like others." onClose=${onClose}>
    ${form.row(presetField(presets, preset), {}, (chosen) => {
      setName(chosen);
      setRanges([FIRST_RANGE]);
      form.start({});
    })}
    ${OWN.map((field) => form.row(field))}
    ${form.row(total)}
    <fieldset class="field-list"><legend>Drawn fields</legend>
      <p class="field-help">Each trial draws its values from these ranges; log draws small and large
        ones alike.</p>
      ${ranges.map((one, place) => html`<${RangeRow} key=${one.id} one=${one} drawable=${drawable} free=${free}
        fault=${form.faults[`ranges.${one.path}`]} onChange=${(more) => change(place, more)}
        onRemove=${ranges.length > 1 ? () => setRanges((now) => now.filter((_, k) => k !== place)) : null} />`)}
      ${form.faults.ranges && html`<p class="field-error" role="alert">${form.faults.ranges}</p>`}
      ${ranges.length < MAX_RANGES && html`<button type="button" class="tool" data-action="add-range"
        onClick=${() => setRanges((now) => [...now, { id: now.at(-1).id + 1, path: free[0].name }])}>
        <${Icon} name="plus" />Add a field</button>`}
    </fieldset>
    ${COUNTS.map((field) => form.row(field))}
    ${form.row({ name: "objective.protocol", title: "Evaluation",
      ...protocolField(protocols.items, preset.objectives, preset.objectives[0]) })}
    ${[{ ...QUANTITY, choices: preset.quantities }, EPISODES, PRUNE].map((field) => form.row(field))}
  </${StartForm}>`;
}

/** The range of a row; empty ends are the limits of the field. */
function rangeOf({ path, low, high, log, choices }, preset) {
  const field = preset.fields.find((f) => f.name === path);
  if (field?.choices) return { choices: choices ?? field.choices };
  const end = (text, limit) => (text?.trim() ? parsed(text) : limit);
  return { low: end(low, field.minimum), high: end(high, field.maximum), ...(log && { log: true }) };
}

function RangeRow({ one, drawable, free, fault, onChange, onRemove }) {
  const field = drawable.find((f) => f.name === one.path);
  const fields = drawable.filter((f) => f === field || free.includes(f));
  const chosen = one.choices ?? field?.choices;
  const toggle = (choice) => onChange({ choices: chosen.includes(choice)
    ? chosen.filter((c) => c !== choice) : [...chosen, choice] });
  const input = (name, label, limit) => html`<input type="text" inputmode="decimal" value=${one[name] ?? ""}
    data-range=${name} placeholder=${String(limit)} aria-label=${`${label} of ${field.title}`}
    aria-invalid=${String(Boolean(fault))} onInput=${(e) => onChange({ [name]: e.target.value })} />`;
  return html`<div class="drawn" data-path=${one.path}>
    <select value=${one.path} aria-label="Drawn field" title=${one.path}
      onChange=${(e) => onChange({ path: e.target.value, low: "", high: "", choices: undefined })}>
      ${byGroup(fields).map(([group, members]) => html`<optgroup key=${group} label=${group}>
        ${members.map((f) => html`<option key=${f.name} value=${f.name}>${f.title}${
          f.unit && ` [${f.unit}]`}</option>`)}</optgroup>`)}</select>
    ${onRemove && html`<${Close} label=${`Remove ${field.title}`} onClick=${onRemove} />`}
    <code class="raw-name">${one.path}</code>
    <div class="range-ends">${field.choices
      ? field.choices.map((c) => html`<label key=${c}><input type="checkbox" checked=${chosen.includes(c)}
          onChange=${() => toggle(c)} /> ${c}</label>`)
      : html`<span>from</span>${input("low", "Least value", field.minimum)}
        <span>to</span>${input("high", "Greatest value", field.maximum)}
        <label><input type="checkbox" checked=${Boolean(one.log)} data-range="log"
          onChange=${() => onChange({ log: !one.log })} /> log</label>`}</div>
    ${fault && html`<p class="field-error" role="alert">${fault}</p>`}</div>`;
}
