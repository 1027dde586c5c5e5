// The form that starts a training job; every field comes from GET /v1/presets.
import { html, useEffect, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { get, post, Unreachable } from "../api.js";
import { Icon } from "../icons.js";

const FIRST_FIELDS = ["cell", "learning.total_steps", "learning.n_envs", "learning.lr_start"];

export function usePresets(link) {
  const [state, setState] = useState({ presets: null, error: null });
  useEffect(() => {
    if (link !== "live" || state.presets) return;
    get("v1/presets").then(
      (answer) => setState({ presets: answer.items, error: null }),
      (error) => setState({ presets: null, error }));
  }, [link]);
  return state;
}

/**
 * The form; `cell` is the name of the cell that is shown: what is trained is for it. With
 * `from`, a job, it starts a job like that one with the changes that are made here.
 */
export function TrainForm({ presets, error, cell, from, onStarted, onClose }) {
  const [name, setName] = useState(from?.preset ?? null);
  const [typed, setTyped] = useState(() => texts(from?.overrides));
  const [seed, setSeed] = useState(String(from?.seed ?? 1));
  const [label, setLabel] = useState("");
  const [problem, setProblem] = useState(null);
  const [busy, setBusy] = useState(false);
  const form = useRef(null);
  const attempt = useRef(key()); // one submission, however often it is sent
  useEffect(() => form.current?.querySelector("select:enabled, input")?.focus(), [presets !== null]);
  const preset = presets?.find((p) => p.name === name)
    ?? presets?.find((p) => p.cell === cell) ?? presets?.[0] ?? null;
  const values = from ? typed : { ...shownCell(preset, cell), ...typed };

  const submit = async (event) => {
    event.preventDefault();
    setBusy(true);
    setProblem(null);
    try {
      const own = overrides(preset, values);
      const labels = { seed: parsed(seed), name: label || null };
      const job = from
        ? await post(`v1/jobs/${from.id}/clone`, {
          ...labels, overrides: patchOf(from.overrides, own),
        }, { "Idempotency-Key": attempt.current })
        : await post("v1/jobs", {
          kind: "train", preset: preset.name, ...labels, overrides: own,
        }, { "Idempotency-Key": attempt.current });
      onStarted(job);
    } catch (refused) {
      attempt.current = refused instanceof Unreachable ? attempt.current : key();
      setProblem(refused);
      requestAnimationFrame(() => form.current?.querySelector("[aria-invalid=true]")?.focus());
    }
    setBusy(false);
  };

  if (error) {
    return html`<p class="notice bad" role="alert"><${Icon} name="alert" />
      The presets could not be loaded: ${error.message}</p>`;
  }
  if (from && presets && preset?.name !== from.preset) {
    return html`<p class="notice bad" role="alert"><${Icon} name="alert" />
      Job ${from.number} was trained with the preset ${from.preset}, which does not exist any more.</p>`;
  }
  if (!preset) return html`<div class="skeleton tall" aria-busy="true"></div>`;
  const faults = faultsByField(problem, preset);
  const fields = preset.fields ?? [];
  const rest = fields.filter((f) => !FIRST_FIELDS.includes(f.name));
  const inRest = rest.some((f) => faults[f.name] || changed(f, values));
  const type = (name, text) => {
    setTyped((now) => ({ ...now, [name]: text }));
    setProblem((now) => without(now, name, preset));
  };
  const row = (f) => html`<${Field} key=${f.name} field=${f} text=${values[f.name]}
    fault=${faults[f.name]} onText=${(text) => type(f.name, text)} />`;
  const title = from ? `Clone of job ${from.number}` : "New training job";
  return html`<form class="train" ref=${form} onSubmit=${submit} noValidate
    aria-label=${title}>
    <div class="train-head"><h3>${title}</h3>
      <button type="button" class="quiet-button" aria-label="Close the form" onClick=${onClose}>
        <${Icon} name="close" /></button></div>
    ${faults[""] && html`<p class="notice bad" role="alert"><${Icon} name="alert" />
      <span>${faults[""]}</span></p>`}
    <div class="field">
      <label for="train-preset">Preset</label>
      <select id="train-preset" value=${preset.name} aria-describedby="preset-help"
        disabled=${Boolean(from)}
        aria-invalid=${String(Boolean(faults.preset))}
        onChange=${(e) => { setName(e.target.value); setTyped({}); setProblem(null); }}>
        ${presets.map((p) => html`<option key=${p.name} value=${p.name}>${p.name}</option>`)}
      </select>
      <p class="field-help" id="preset-help">${preset.title ?? preset.help ?? preset.description}</p>
      ${faults.preset && html`<p class="field-error" role="alert">${faults.preset}</p>`}
    </div>
    <${Field} field=${{ name: "seed", default: 1, help: "Runs are reproducible for a given seed." }}
      text=${seed} fault=${faults.seed} onText=${(text) => {
        setSeed(text);
        setProblem((now) => without(now, "seed", preset));
      }} />
    <${Field} field=${{ name: "name", default: "", help: "For the list of jobs; may be empty." }}
      text=${label} fault=${faults.name} onText=${(text) => {
        setLabel(text);
        setProblem((now) => without(now, "name", preset));
      }} />
    ${fields.filter((f) => FIRST_FIELDS.includes(f.name)).map(row)}
    ${rest.length > 0 && html`<details class="more" open=${inRest || undefined}>
      <summary><${Icon} name="chevron" />${rest.length} more settings</summary>
      ${byGroup(rest).map(([group, members]) => html`<fieldset key=${group}>
        <legend>${capital(group)}</legend>${members.map(row)}</fieldset>`)}
    </details>`}
    <div class="train-foot">
      <button type="submit" class="primary" disabled=${busy}>
        ${busy ? "Starting …" : "Start training"}</button>
      <span class="faint">Runs in its own process, beside the cell.</span>
    </div>
  </form>`;
}

function Field({ field, text, fault, onText }) {
  const id = `train-${field.name.replace(".", "-")}`;
  const own = text !== undefined && changed(field, { [field.name]: text });
  const described = [fault && `${id}-error`, `${id}-help`].filter(Boolean).join(" ");
  return html`<div class=${`field ${own ? "is-changed" : ""}`}>
    <label for=${id}>${field.title ?? capital(field.name)}${field.unit && html`<span class="unit"> [${field.unit}]</span>`}</label>
    ${isChoice(field)
      ? html`<select id=${id} name=${field.name} value=${text ?? String(field.default)}
          onChange=${(e) => onText(e.target.value)}>
          ${choices(field).map((c) => html`<option key=${c} value=${c}>${c}</option>`)}</select>`
      : html`<input id=${id} name=${field.name} type="text" inputmode="decimal" spellcheck="false"
          autocomplete="off" value=${text ?? show(field.default)} aria-describedby=${described}
          aria-invalid=${String(Boolean(fault))} onInput=${(e) => onText(e.target.value)} />`}
    ${fault && html`<p class="field-error" id=${`${id}-error`} role="alert">${fault}</p>`}
    <p class="field-help" id=${`${id}-help`}>${helpText(field)}</p>
  </div>`;
}

/** The cell that is shown, as if it had been chosen, where the preset can be trained in it. */
function shownCell(preset, cell) {
  const field = preset?.fields?.find((f) => f.name === "cell");
  return field?.choices?.includes(cell) ? { cell } : {};
}

/** Sentences: what the field does, and its range. */
function helpText(field) {
  const help = String(field.help ?? "").trim();
  const sentence = help && `${capital(help)}${/[.!?]$/.test(help) ? "" : "."}`;
  return [sentence, rangeText(field)].filter(Boolean).join(" ");
}

function rangeText({ minimum, maximum }) {
  const [low, high] = [minimum, maximum].map((v) => (Number.isFinite(v) ? show(v) : null));
  if (low !== null && high !== null) return `${low} to ${high}.`;
  if (low !== null) return `At least ${low}.`;
  return high !== null ? `At most ${high}.` : "";
}

function isChoice(field) {
  return field.type === "bool" || Array.isArray(field.choices);
}

function choices(field) {
  return field.type === "bool" ? ["true", "false"] : field.choices.map(String);
}

/** Fields by their group, in order: pairs of the group's name and its fields. */
function byGroup(fields) {
  const groups = new Map();
  for (const field of fields) {
    const group = field.name.split(".")[0];
    groups.set(group, [...(groups.get(group) ?? []), field]);
  }
  return [...groups];
}

function show(v) {
  return typeof v === "string" ? v : JSON.stringify(v);
}

/** Text as the JSON it stands for; what is no JSON goes as text, and the service says so. */
function parsed(text) {
  const plain = String(text).trim().replaceAll("_", "").replace(/(?<=\d)[\s\u202f](?=\d)/g, "");
  try {
    return JSON.parse(plain);
  } catch {
    return Number.isFinite(Number(plain)) && plain !== "" ? Number(plain) : String(text);
  }
}

function changed(field, texts) {
  const text = texts[field.name];
  return text !== undefined && JSON.stringify(parsed(text)) !== JSON.stringify(field.default);
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
  return Object.fromEntries(Object.entries(overrides ?? {}).flatMap(([group, value]) =>
    value && typeof value === "object" && !Array.isArray(value)
      ? Object.entries(value).map(([name, v]) => [`${group}.${name}`, show(v)])
      : [[group, show(value)]]));
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

/** The single faults that a problem lists. */
function faultsOf(problem) {
  return problem?.errors?.length ? problem.errors : problem?.field ? [problem] : [];
}

/** Name of the form's field that a fault is about; "" where it is none of them. */
function fieldOf(fault, preset) {
  const names = new Set(["seed", "name", "preset", ...(preset.fields ?? []).map((f) => f.name)]);
  const path = String(fault.field ?? "");
  const name = path.replace(/^overrides\./, "");
  return names.has(name) ? name : "";
}

/** What is left of a problem once a field was edited: the faults of the other fields. */
function without(problem, name, preset) {
  const rest = faultsOf(problem).filter((one) => !["", name].includes(fieldOf(one, preset)));
  return rest.length ? { message: problem.message, errors: rest } : null;
}

/** Where each fault of a problem belongs: by field name, "" for the form as a whole. */
function faultsByField(problem, preset) {
  if (!problem) return {};
  const listed = faultsOf(problem);
  const faults = {};
  for (const one of listed) {
    const name = fieldOf(one, preset);
    const choice = one.choices?.length ? ` Choices: ${one.choices.join(", ")}.` : "";
    faults[name] = name
      ? `${capital(one.rule ?? problem.message)}.${choice}`.replace(/\.\.(?= |$)/, ".")
      : problem.message;
  }
  if (listed.length === 0) faults[""] = problem.message;
  return faults;
}

function capital(text) {
  return String(text)[0].toUpperCase() + String(text).slice(1);
}

function key() {
  return crypto.randomUUID?.() ?? `${Date.now()}-${Math.random()}`;
}

