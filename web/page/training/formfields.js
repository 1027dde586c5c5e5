// Forms: what is typed, one submission at a time, and the faults that the service finds in it.
import { html, useEffect, useMemo, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { get, inTurn, Unreachable } from "../api.js";
import { capital, grouped, sentence } from "../format.js";
import { Alert, Close } from "../icons.js";
import { answers } from "../live/world-stream.js";

export const PURPOSES = { "choosing tasks": "task selection", "reaching goals": "reach", sorting: "sorting" };
const AGAIN_MS = 3000; // pause before a request that failed is sent again

/**
 * A form whose fields are `names`; `typed` are their texts at the start. `submit(send)` sends it
 * with the key of this submission, which stays while the server is not reached.
 */
export function useForm({ typed: first = {}, names, onDone, prefix = "train" }) {
  const [typed, setTyped] = useState(first);
  const [problem, setProblem] = useState(null);
  const [busy, setBusy] = useState(false);
  const ref = useRef(null);
  const attempt = useRef(key());
  const faults = faultsByField(problem, names);
  const type = (name, text) => {
    setTyped((now) => ({ ...now, [name]: text }));
    setProblem((now) => without(now, name, names));
  };
  const submit = (send) => async (event) => {
    event.preventDefault();
    setBusy(true);
    setProblem(null);
    try {
      onDone(await send({ "Idempotency-Key": attempt.current }));
    } catch (refused) {
      attempt.current = refused instanceof Unreachable ? attempt.current : key();
      setProblem(refused);
      requestAnimationFrame(() => ref.current?.querySelector("[aria-invalid=true]")?.focus());
    }
    setBusy(false);
  };
  const row = (field, values = typed, onText = (text) => type(field.name, text)) => html`<${Field}
    key=${field.name} field=${field} text=${values[field.name]}
    fault=${faults[field.name]} prefix=${prefix} onText=${onText} />`;
  const start = (values) => {
    setTyped(values);
    setProblem(null);
  };
  return { ref, typed, faults, busy, type, submit, row, start };
}

/** The items of a route, asked for while the server is there until it answers; or the error. */
export function useItems(link, path, cause = null) {
  return useLoaded(link, (options) => get(path, options).then(({ items }) => items), cause);
}

/** The items that `load` promises, asked for as those of a route are; again for another `cause`. */
export function useLoaded(link, load, cause = null) {
  const [state, setState] = useState({ items: null, error: null });
  const known = useRef(null); // the cause for which the items were loaded
  useEffect(() => {
    if (!answers(link) || (state.items && known.current === cause)) return undefined;
    const stop = new AbortController();
    let timer = null;
    const ask = () => load({ signal: stop.signal }).then(
      (items) => {
        if (stop.signal.aborted) return;
        known.current = cause;
        setState({ items, error: null });
      },
      (error) => {
        if (stop.signal.aborted) return;
        setState((now) => ({ ...now, error }));
        timer = setTimeout(ask, AGAIN_MS);
      });
    ask();
    return () => {
      stop.abort();
      clearTimeout(timer);
    };
  }, [link, cause]);
  return state;
}

/** The answer of a route, asked for again by `refresh` and whenever one of `causes` has changed. */
export function useAnswer(path, ...causes) {
  const [state, setState] = useState({ answer: null, error: null });
  const { ask, stop } = useMemo(() => {
    const stop = new AbortController();
    const ask = inTurn(() => get(path, { signal: stop.signal }).then(
      (answer) => stop.signal.aborted || setState({ answer, error: null }),
      (error) => stop.signal.aborted || setState((now) => ({ ...now, error }))));
    return { ask, stop };
  }, [path]);
  useEffect(() => () => stop.abort(), [stop]);
  useEffect(() => void ask.run(), [ask, ...causes]);
  return { ...state, refresh: ask.run };
}

/** What a form shows while its choices are loaded, or could not be. */
export function Loading({ what, error, onClose }) {
  return error
    ? html`<${Alert}>${sentence(`The ${what} could not be loaded: ${error.message}`)} Trying
        again every ${AGAIN_MS / 1000} s.
        ${" "}<button type="button" class="text-button" onClick=${onClose}>Close</button></${Alert}>`
    : html`<div class="skeleton tall" aria-busy="true" aria-label=${`Loading ${what}`}></div>`;
}

export const OWN = [
  { name: "seed", default: 1, help: "Runs are reproducible for a given seed." },
  { name: "name", type: "text", default: "", help: "For the list of jobs; may be empty." },
];

/** The frame of a form that starts a job: title, faults of the whole, button and a note. */
export function StartForm({ form, title, send, start, note, onClose, children }) {
  const fault = form.faults[""];
  return html`<form class="train" ref=${form.ref} onSubmit=${form.submit(send)} noValidate
    aria-label=${title}>
    <div class="train-head"><h3>${title}</h3>
      <${Close} label="Close the form" onClick=${onClose} /></div>
    ${fault && html`<${Alert}>${fault}</${Alert}>`}
    ${children}
    <div class="train-foot">
      <button type="submit" class="primary" disabled=${form.busy}>
        ${form.busy ? "Starting …" : start}</button>
      ${note && html`<span class="faint">${note}</span>`}
    </div>
  </form>`;
}

/** The choice of a preset by its title, as a field of a form. */
export function presetField(presets, preset, disabled = false) {
  return { name: "preset", default: preset.name, choices: presets.map(({ name }) => name),
    labels: Object.fromEntries(presets.map(({ name, title }) => [name, title])), wide: true, named: true, disabled };
}

/** What a protocol evaluates, without the verb; its name where that is not known. */
export function protocolTitle(protocols, name) {
  const title = protocols?.find((one) => one.name === name)?.title;
  return title ? capital(title.replace(/^Evaluate /, "").replace(/\.$/, "")) : name;
}

/** The choice of a protocol by what it evaluates; `names` are the choices. */
export function protocolField(protocols, names, chosen) {
  const known = (protocols ?? []).filter(({ name }) => names.includes(name));
  return { default: chosen, choices: names, wide: true, named: true,
    labels: Object.fromEntries(known.map(({ name }) => [name, protocolTitle(known, name)])),
    groups: Object.fromEntries(known.map(({ name, purpose }) => [name, capital(PURPOSES[purpose] ?? "safety layer")])) };
}

/**
 * One field with its unit, help and fault; `prefix` keeps the fields of several forms apart.
 * A `wide` one has a line for its choices; `named` shows the chosen one's own name below its label.
 */
export function Field({ field, text, fault, onText, prefix }) {
  const id = `${prefix}-${field.name.replaceAll(".", "-")}`;
  const own = text !== undefined && changed(field, { [field.name]: text });
  const help = helpText(field);
  const described = [fault && `${id}-error`, field.named && `${id}-name`, help && `${id}-help`].filter(Boolean).join(" ");
  return html`<div class=${`field ${own ? "is-changed" : ""} ${field.wide ? "is-wide" : ""}`}>
    <label for=${id}>${field.title ?? capital(field.name)}${field.unit && html`<span class="unit"> [${field.unit}]</span>`}</label>
    ${isChoice(field)
      ? html`<select id=${id} name=${field.name} value=${text ?? String(field.default)}
          aria-describedby=${described} aria-invalid=${String(Boolean(fault))} disabled=${field.disabled}
          title=${field.labels?.[text ?? field.default]}
          onChange=${(e) => onText(e.target.value)}><${Options} field=${field} /></select>`
      : html`<input id=${id} name=${field.name} type="text" inputmode=${keyboard(field)} spellcheck="false"
          autocomplete="off" value=${text ?? grouped(field.default)} aria-describedby=${described}
          aria-invalid=${String(Boolean(fault))} onInput=${(e) => onText(e.target.value)} />`}
    ${field.named && html`<code class="raw-name" id=${`${id}-name`}>${text ?? field.default}</code>`}
    ${fault && html`<p class="field-error" id=${`${id}-error`} role="alert">${fault}</p>`}
    ${help && html`<p class="field-help" id=${`${id}-help`}>${help}</p>`}
  </div>`;
}

/** The choices of a field by their labels, in groups where it has some. */
function Options({ field }) {
  const options = (group) => choices(field).filter((c) => field.groups?.[c] === group)
    .map((c) => html`<option key=${c} value=${c}>${field.labels?.[c] ?? c}</option>`);
  const groups = [...new Set(Object.values(field.groups ?? {}))];
  return html`${options(undefined)}${groups.map((group) => html`<optgroup key=${group}
    label=${group}>${options(group)}</optgroup>`)}`;
}

/** What the field does and its range, as sentences. */
function helpText(field) {
  const help = String(field.help ?? "").trim();
  return [help && sentence(help), rangeText(field)].filter(Boolean).join(" ");
}

function rangeText({ minimum, maximum }) {
  const [low, high] = [minimum, maximum].map((v) => (Number.isFinite(v) ? grouped(v) : null));
  if (low !== null && high !== null) return `${low} to ${high}.`;
  if (low !== null) return `At least ${low}.`;
  return high !== null ? `At most ${high}.` : "";
}

/** The keyboard of a phone: that of decimal numbers lacks letters and, on some, a minus sign. */
function keyboard({ type, minimum }) {
  return type === "text" || minimum < 0 ? "text" : "decimal";
}

function isChoice(field) {
  return field.type === "bool" || Array.isArray(field.choices);
}

function choices(field) {
  return field.type === "bool" ? ["true", "false"] : field.choices.map(String);
}

/**
 * Text as the JSON it stands for. What is no JSON goes as text, and so do integers that a number
 * would round: the service says that it does not take them.
 */
export function parsed(text) {
  const plain = String(text).trim().replaceAll("_", "").replace("\u2212", "-")
    .replace(/(?<=\d)[\s\u202f](?=\d)/g, "");
  if (/^-?\d+$/.test(plain) && !Number.isSafeInteger(Number(plain))) return plain;
  try {
    return JSON.parse(plain);
  } catch {
    return Number.isFinite(Number(plain)) && plain !== "" ? Number(plain) : String(text);
  }
}

export function changed(field, texts) {
  const text = texts[field.name];
  return text !== undefined && JSON.stringify(parsed(text)) !== JSON.stringify(field.default);
}

/** The single faults that a problem lists. */
function faultsOf(problem) {
  return problem?.errors?.length ? problem.errors : problem?.field ? [problem] : [];
}

/** Name of the form's field that a fault is about; "" where it is none of them. */
function fieldOf(fault, names) {
  const name = String(fault.field ?? "").replace(/^overrides\./, "");
  return names.find((one) => name === one)
    ?? names.find((one) => name.startsWith(`${one}.`) || name.startsWith(`${one}[`)) ?? "";
}

/** What is left of a problem once a field was edited: the faults of the other fields. */
function without(problem, name, names) {
  const rest = faultsOf(problem).filter((one) => !["", name].includes(fieldOf(one, names)));
  return rest.length ? { message: problem.message, errors: rest } : null;
}

/** Where each fault of a problem belongs: by field name, "" for the form as a whole. */
function faultsByField(problem, names) {
  if (!problem) return {};
  const listed = faultsOf(problem);
  const faults = {};
  for (const one of listed) {
    const name = fieldOf(one, names);
    const choice = one.choices?.length ? ` Choices: ${one.choices.join(", ")}.` : "";
    faults[name] = name
      ? `${sentence(capital(one.rule ?? problem.message))}${choice}`
      : sentence(problem.message);
  }
  if (listed.length === 0) faults[""] = sentence(problem.message);
  return faults;
}

/** The key of one submission, however often it is sent. */
function key() {
  return crypto.randomUUID?.() ?? `${Date.now()}-${Math.random()}`;
}
