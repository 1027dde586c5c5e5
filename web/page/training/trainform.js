// The form that starts a training job; every field comes from GET /v1/presets.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { post } from "../api.js";
import { count, grouped } from "../format.js";
import { Alert, Icon } from "../icons.js";
import { BUDGETS, budgetBody, budgetTexts } from "./budgets.js";
import { byGroup, dotted, presetFor, shownCell } from "./fieldnames.js";
import { changed, Loading, OWN, parsed, presetField, StartForm, useForm } from "./formfields.js";

const FIRST_FIELDS = ["cell", "learning.total_steps", "learning.n_envs", "learning.lr_start"];
/**
 * The form; `cell` is the name of the cell that is shown: what is trained is for it. With
 * `from`, a job, it starts a job like that one with the changes that are made here.
 */
export function TrainForm({ presets: { items: presets, error }, cell, from, onStarted, onClose }) {
  const [name, setName] = useState(from?.preset ?? null);
  const preset = presetFor(presets, name, cell);
  const fields = preset?.fields ?? [];
  const form = useForm({
    typed: { seed: String(from?.seed ?? 1), ...texts(from?.overrides), ...budgetTexts(from) },
    names: ["preset", ...[...OWN, ...BUDGETS, ...fields].map((field) => field.name)],
    onDone: onStarted,
  });
  useEffect(() => {
    if (document.activeElement?.role === "radio") return; // the kind of job is being chosen
    form.ref.current?.querySelector("select:enabled, input")?.focus();
  }, [presets !== null]);
  const values = from ? form.typed : { ...shownCell(preset, cell), ...form.typed };
  const send = (key) => {
    const own = overrides(preset, values);
    const body = { name: values.name || null, ...budgetBody(values) };
    // A seed that is not changed is left to the service: beyond 2^53 the page knows it rounded.
    if (!from || values.seed !== String(from.seed)) body.seed = parsed(values.seed);
    return from
      ? post(`v1/jobs/${from.id}/clone`, { ...body, overrides: patchOf(from.overrides, own) }, key)
      : post("v1/jobs", { kind: "train", preset: preset.name, ...body, overrides: own }, key);
  };

  if (from && presets && preset?.name !== from.preset) {
    return html`<${Alert}>Job ${from.number} was trained with the preset ${from.preset}, which does not
      exist any more: start a new job instead.
      ${" "}<button type="button" class="text-button" onClick=${onClose}>Close</button></${Alert}>`;
  }
  if (!preset) return html`<${Loading} what="presets" error=${error} onClose=${onClose} />`;
  const rest = fields.filter((f) => !FIRST_FIELDS.includes(f.name));
  const inRest = rest.some((f) => form.faults[f.name] || changed(f, values));
  const title = from ? `Clone of job ${from.number}` : "New training job";
  const row = (field) => form.row(field, values);
  return html`<${StartForm} form=${form} title=${title} send=${send} start="Start training"
    note="Runs in its own process, beside the cell." onClose=${onClose}>
    ${form.row(presetField(presets, preset, Boolean(from)), {}, (chosen) => {
      setName(chosen);
      form.start({ seed: values.seed, name: values.name ?? "" });
    })}
    ${OWN.map(row)}
    ${fields.filter((f) => FIRST_FIELDS.includes(f.name)).map(row)}
    ${BUDGETS.map(row)}
    ${rest.length > 0 && html`<details class="more" open=${inRest || undefined}>
      <summary><${Icon} name="chevron" />${count(rest.length, "more setting")}</summary>
      ${byGroup(rest).map(([group, members]) => html`<fieldset key=${group}>
        <legend>${group}</legend>${members.map(row)}</fieldset>`)}
    </details>`}
  </${StartForm}>`;
}

function overrides(preset, texts) {
  const found = {};
  for (const field of (preset.fields ?? []).filter((f) => changed(f, texts))) {
    const [group, name] = field.name.split(".");
    const value = parsed(texts[field.name]);
    found[group] = name ? { ...found[group], [name]: value } : value;
  }
  return found;
}

/** A job's overrides as the texts of the form's fields, by dotted name. */
function texts(overrides) {
  return Object.fromEntries(dotted(overrides).map(([name, v]) => [name, grouped(v)]));
}

/** The merge patch that makes `wanted` of the overrides `now`: null removes a member. */
function patchOf(now, wanted) {
  const patch = { ...wanted };
  for (const [name, value] of Object.entries(now ?? {})) {
    if (!(name in wanted)) patch[name] = null;
    else if (value && typeof value === "object" && !Array.isArray(value)) {
      patch[name] = patchOf(value, wanted[name]);
    }
  }
  return patch;
}
