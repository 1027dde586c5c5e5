// The form that starts an evaluation; its choices come from the server.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { post } from "../api.js";
import * as format from "../format.js";
import { storedCheckpoints } from "./checkpoints.js";
import { presetTitle } from "./fieldnames.js";
import { Loading, OWN, parsed, protocolField, StartForm, useForm, useItems, useLoaded } from "./formfields.js";

const SEED = { ...OWN[0], default: 11 };

export function EvaluateForm({ link, presets, protocols, onStarted, onClose }) {
  const checkpoints = useLoaded(link, storedCheckpoints);
  const recordings = useItems(link, "v1/recordings");
  const form = useForm({
    names: ["protocol", "checkpoint", "episodes", "seed", "name", "recordings"],
    prefix: "evaluate", onDone: onStarted,
  });
  const error = protocols.error ?? checkpoints.error ?? recordings.error;
  if (!protocols.items || !checkpoints.items || !recordings.items) {
    return html`<${Loading} what="choices" error=${error} onClose=${onClose} />`;
  }
  const { typed } = form;
  const protocol = protocols.items.find(({ name }) => name === typed.protocol) ?? protocols.items[0];
  const chosen = typed.recordings ?? [];
  const field = protocol.purpose && checkpointField(protocol, checkpoints.items, presets);
  const checkpoint = field && field.choices.includes(typed.checkpoint) ? typed.checkpoint : "";
  const send = (key) => post("v1/jobs", {
    kind: "evaluate",
    protocol: protocol.name,
    checkpoint: checkpoint || null,
    episodes: typed.episodes?.trim() ? parsed(typed.episodes) : null,
    seed: parsed(typed.seed ?? String(SEED.default)),
    name: typed.name || null,
    ...(protocol.recordings !== "none" && { recordings: chosen }),
  }, key);
  return html`<${StartForm} form=${form} title="New evaluation" send=${send} start="Start evaluation"
    note="Runs in its own process, beside the cell." onClose=${onClose}>
    ${form.row({ name: "protocol", ...protocolField(protocols.items,
      protocols.items.map(({ name }) => name), protocol.name) }, { protocol: protocol.name })}
    ${field && form.row(field, { checkpoint })}
    ${form.row({ name: "episodes", default: "", minimum: 1, maximum: protocol.max_episodes,
      help: "Empty for the evaluation's own number" })}
    ${[SEED, OWN[1]].map((field) => form.row(field))}
    ${protocol.recordings !== "none" && html`<${Recordings} all=${recordings.items} chosen=${chosen}
      required=${protocol.recordings === "required"} fault=${form.faults.recordings}
      onChange=${(names) => form.type("recordings", names)} />`}
  </${StartForm}>`;
}

/** Stored checkpoints of the purpose of a protocol; empty is the protocol's own. */
function checkpointField(protocol, checkpoints, presets) {
  const fitting = checkpoints.filter(({ purpose }) => purpose === protocol.purpose);
  const labels = Object.fromEntries(fitting.map((one) => [one.sha256,
    [one.aliases[0] ?? format.short(one.sha256),
      presetTitle(presets, one.preset ?? one.manifest.preset?.name),
      format.count(one.step ?? one.manifest.step, "step")].filter(Boolean).join(" · ")]));
  return {
    name: "checkpoint", wide: true, choices: ["", ...fitting.map(({ sha256 }) => sha256)], default: "",
    labels: { "": `default: ${protocol.checkpoint}`, ...labels },
    help: fitting.length ? "" : "No stored checkpoint is of the kind that this protocol takes",
  };
}

function Recordings({ all, chosen, required, fault, onChange }) {
  const toggle = (name) => onChange(chosen.includes(name)
    ? chosen.filter((one) => one !== name) : [...chosen, name]);
  return html`<fieldset class="field-list"><legend>Recordings${required ? "" : " (optional)"}</legend>
    ${all.length === 0 && html`<p class="field-help">No recording is stored yet: import one below
      the scene (motion source Recording).</p>`}
    ${all.map(({ name }) => html`<label key=${name}><input type="checkbox" data-recording=${name}
      checked=${chosen.includes(name)} onChange=${() => toggle(name)} /> ${name}</label>`)}
    ${fault && html`<p class="field-error" role="alert">${fault}</p>`}</fieldset>`;
}
