// Stored checkpoints: card, use, evaluations, aliases, upload, delete, two of them side by side.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { Ask, Fault, useAction } from "../action.js";
import { inTurn, postFile, put, remove } from "../api.js";
import * as format from "../format.js";
import { Alert, Icon } from "../icons.js";
import { answers } from "../live/world-stream.js";
import { dotted, Facts, FieldName, fieldValue, presetTitle } from "./fieldnames.js";
import { PURPOSES, protocolTitle } from "./formfields.js";
import { useListFocus } from "../listfocus.js";
import { measuresOf } from "./measures.js";
import { PAGE, storedCheckpoints } from "./checkpoints.js";

/** Names that the service takes, but for those of 64 hexadecimal digits; others, such as with a slash, have no route. */
const ALIAS = /^[a-z0-9][a-z0-9._-]{0,63}$/;
const ALIAS_RULE = "An alias has 1 to 64 of the characters a-z 0-9 . _ - and starts with a-z or 0-9.";

/** The section of the checkpoints; `acting` are the SHA-256 of those of the live cell. */
export function CheckpointCards({ link, jobs, acting, presets, protocols }) {
  const section = useListFocus();
  const [list, setList] = useState(null);
  const [error, setError] = useState(null);
  const [open, setOpen] = useState(null);
  const [pair, setPair] = useState([]);
  const [{ run: refresh }] = useState(() => inTurn(() => storedCheckpoints().then(
    (stored) => { setList(stored); setError(null); }, setError)));
  const stamp = (jobs ?? []).map((job) => `${job.id}:${job.state}:${job.step}`).join();
  useEffect(() => { if (answers(link)) refresh(); }, [link, stamp]);
  const choose = (sha256) => setPair((now) =>
    (now.includes(sha256) ? now.filter((one) => one !== sha256) : [...now, sha256].slice(-2)));
  const compared = pair.map((sha256) => list?.find((c) => c.sha256 === sha256)).filter(Boolean);
  return html`<section class="card" aria-labelledby="checkpoints-title" data-role="checkpoints"
    ref=${section}>
    <header class="card-head"><h2 id="checkpoints-title" tabindex="-1">Checkpoints</h2></header>
    <${Upload} onDone=${(one) => { refresh(); setOpen(one.sha256); }} />
    ${error && html`<${Alert}>${format.sentence(`The checkpoints could not be loaded: ${error.message}`)}
      ${" "}<button type="button" class="text-button" onClick=${refresh}>Try again</button></${Alert}>`}
    ${!list && !error && html`<div class="skeleton" aria-busy="true" aria-label="Loading checkpoints"></div>`}
    ${list?.length === 0 && html`<p class="empty">No checkpoints yet: train a policy with a new job, or
      upload a checkpoint.</p>`}
    ${compared.length === 2 && html`<${Comparison} pair=${compared} jobs=${jobs} presets=${presets}
      onClose=${() => setPair([])} />`}
    ${compared.length === 1 && html`<p class="faint" role="status">Open a second checkpoint and tick Compare in it, too.</p>`}
    <ul class="jobs">${(list ?? []).map((one) => html`<${Card} key=${one.sha256} one=${one}
      open=${open === one.sha256} chosen=${pair.includes(one.sha256)} ...${{ acting, jobs, presets, protocols }}
      onOpen=${setOpen} onChoose=${choose} onChanged=${refresh} />`)}</ul>
    ${list?.length >= PAGE && html`<p class="faint list-end">The newest ${PAGE} and those with an alias are
      shown.</p>`}
  </section>`;
}

function Card({ one, open, chosen, acting, jobs, presets, protocols, onOpen, onChoose, onChanged }) {
  const acts = acting.includes(one.sha256);
  return html`<li class=${`stored ${open ? "is-open" : ""}`} data-checkpoint=${one.sha256}>
    <button type="button" class="job-head" aria-expanded=${String(open)}
      onClick=${() => onOpen(open ? null : one.sha256)}>
      <${Icon} name="chevron" />
      <span class="job-name" title=${nameOf(one)}>${nameOf(one, presets)}</span>
      ${acts ? html`<span class="chip chip-good">deployed</span>`
        : html`<span class="chip">${PURPOSES[one.purpose] ?? one.purpose}</span>`}
      <span class="job-sub">${subtitle(one, presets)}</span>
    </button>
    ${open && html`<div class="job-detail">
      <${Facts} entries=${Object.entries(facts(one))} />
      <${Uses} ...${{ one, acts, jobs, protocols }} />
      <${Aliases} one=${one} onChanged=${onChanged} />
      <div class="job-actions">
        <label class="tool"><input type="checkbox" data-action="compare-checkpoint" checked=${chosen}
          onChange=${() => onChoose(one.sha256)} /> Compare</label>
        <a class="tool" download title="Download the tensors" href=${`v1/checkpoints/${one.sha256}/tensors`}>Tensors</a>
        <a class="tool" title="Download the manifest" download=${`${nameOf(one)}.json`}
          href=${`v1/checkpoints/${one.sha256}/manifest`}>Manifest</a>
        ${!one.job_id && one.aliases.length === 0 && html`<${Delete} one=${one} onChanged=${onChanged} />`}
      </div></div>`}
  </li>`;
}

/** Aliases, or the preset and the id; the preset by its name where its title is not asked for. */
function nameOf(one, presets = null) {
  return one.aliases.join(", ")
    || `${presetTitle(presets, one.preset) ?? "checkpoint"} ${format.short(one.sha256)}`;
}

function subtitle(one, presets) {
  const steps = one.step ?? one.manifest.step;
  return [one.aliases.length > 0 && presetTitle(presets, one.preset), Number.isFinite(steps) && format.count(steps, "step"),
    one.shipped.length ? "shipped" : format.ago(one.created_at)].filter(Boolean).join(" · ");
}

function facts(one) {
  const { manifest } = one;
  return {
    ID: format.short(one.sha256),
    Cell: manifest.cell ?? "–",
    Seed: String(manifest.seed ?? "–"),
    Steps: format.steps(one.step ?? manifest.step),
    Updates: format.steps(manifest.updates),
    "CPU time": format.duration(manifest.cpu_s),
    Size: format.size(one.size),
    "Trained with": `torch ${manifest.versions?.torch ?? "–"}`,
    ...recalibration(manifest.recalibration),
  };
}

/** Origin of recalibrated probabilities, if a checkpoint has them. */
function recalibration(record) {
  if (!record) return {};
  const n = Object.values(record.outcomes ?? {}).reduce((sum, count) => sum + count, 0);
  return { "Recalibrated by": `${format.count(n, "outcome")}, from ${format.short(record.from)}` };
}

/** Jobs among the listed ones that evaluated a checkpoint. */
function evaluations(one, jobs) {
  const names = [one.sha256, ...one.aliases];
  return (jobs ?? []).filter((job) => job.kind === "evaluate" && names.includes(job.checkpoint ?? job.spec?.checkpoint));
}

function Uses({ one, acts, jobs, protocols }) {
  const tested = evaluations(one, jobs);
  const maker = jobs?.find((job) => job.id === one.job_id);
  const uses = [
    acts && "Deployed to the live cell",
    one.job_id ? `Made by job ${maker?.number ?? format.short(one.job_id)}`
      : one.shipped.length ? "Shipped"
        : one.manifest.recalibration ? "Recalibrated or uploaded" : "Uploaded",
    ...tested.map((job) => `Job ${job.number} · ${protocolTitle(protocols.items, job.spec.protocol)}: ${job.state}`),
  ].filter(Boolean);
  return html`<ul class="uses" aria-label="Use">${uses.map((text) => html`<li key=${text}>${text}</li>`)}
    </ul>${tested.filter((job) => job.result).map((job) => html`<dl class="rows" key=${job.id}>
      ${job.result.results.map((row) => html`<div key=${row.name}><dt>${row.name}</dt>
        ${measuresOf(row).slice(0, 1).map(([label, text]) => html`<dd key=${label}>
          <span>${label}</span><b>${text}</b></dd>`)}</div>`)}</dl>`)}`;
}

function Aliases({ one, onChanged }) {
  const [name, setName] = useState("");
  const { error, run } = useAction(() => {
    setName("");
    onChanged();
  });
  const add = (event) => {
    event.preventDefault();
    run(() => {
      if (!ALIAS.test(name.trim())) throw new Error(ALIAS_RULE);
      return put(`v1/aliases/${encodeURIComponent(name.trim())}`, { checkpoint: one.sha256 });
    });
  };
  return html`<form class="job-actions" onSubmit=${add} aria-label="Aliases">
    ${one.shipped.map((alias) => html`<span class="chip" key=${alias}
      title="Alias of a shipped checkpoint">${alias}</span>`)}
    ${one.aliases.filter((alias) => !one.shipped.includes(alias)).map((alias) => html`<button
      type="button" class="tool" key=${alias}
      title=${`Remove the alias ${alias}`} aria-label=${`Remove the alias ${alias}`}
      onClick=${() => run(() => remove(`v1/aliases/${encodeURIComponent(alias)}`))}>
      ${alias}<${Icon} name="close" /></button>`)}
    <input data-role="alias" value=${name} placeholder="new alias" aria-label="New alias"
      spellcheck="false" maxlength="64" onInput=${(event) => setName(event.target.value)} />
    <button type="submit" class="tool" data-action="alias" disabled=${!name.trim()}>Add alias</button>
    <${Fault} error=${error} />
  </form>`;
}

/** For checkpoints of users: those of a job go with it, and shipped ones have an alias. */
function Delete({ one, onChanged }) {
  return html`<${Ask} name="delete-checkpoint" label="Delete …" yes="Delete the checkpoint" no="Keep it"
    question="Delete it? Results of its evaluations stay." action=${useAction(onChanged)}
    onYes=${() => remove(`v1/checkpoints/${one.sha256}`)} />`;
}

/** Manifest and tensors, chosen together, as one body: the manifest's line, then the tensors. */
function Upload({ onDone }) {
  const [stored, setStored] = useState(null);
  const { busy, error, run } = useAction((made) => {
    setStored(made);
    onDone(made);
  });
  const send = (event) => {
    const files = [...event.target.files];
    event.target.value = "";
    setStored(null);
    run(async () => {
      const manifest = files.find((file) => file.name.endsWith(".json"));
      const tensors = files.find((file) => file.name.endsWith(".safetensors"));
      if (!manifest || !tensors || files.length !== 2) {
        throw new Error("Choose two files: the manifest (.json) and the tensors (.safetensors).");
      }
      // Line ends stand between members only; the text of the numbers is part of the id.
      const line = (await manifest.text()).replace(/[\r\n]+/g, " ");
      return postFile("v1/checkpoints", new Blob([line, "\n", tensors]));
    });
  };
  return html`<div class="job-actions upload">
    <label class="tool" title="The manifest (.json) and the tensors (.safetensors), at most 16 MiB">
      <input class="sr" type="file" multiple accept=".json,.safetensors" data-role="checkpoint-files"
        disabled=${busy} onChange=${send} />
      <${Icon} name="plus" />${busy ? "Checking …" : "Upload"}</label>
    ${stored && html`<span class="faint" role="status">Stored ${format.short(stored.sha256)}.</span>`}
    <${Fault} error=${error} /></div>`;
}

/** Facts, preset fields and evaluations of two checkpoints: those that differ. */
function Comparison({ pair, jobs, presets, onClose }) {
  const columns = pair.map((one) => ({
    Purpose: PURPOSES[one.purpose] ?? one.purpose, ...facts(one),
    ...shownFields({ ...one.manifest.preset, name: undefined, cell: undefined }), ...latestRates(one, jobs),
  }));
  const names = [...new Set(columns.flatMap(Object.keys))]
    .filter((name) => columns[0][name] !== columns[1][name]);
  return html`<div class="differences" data-role="checkpoint-differences">
    <table><thead><tr><th scope="col">Field</th>
      ${pair.map((one) => html`<th scope="col" key=${one.sha256}>${nameOf(one, presets)}</th>`)}</tr></thead>
    <tbody>${names.map((name) => html`<tr key=${name}><th scope="row"><${FieldName}
      presets=${presets} path=${name} preset=${pair[0].manifest.preset?.name} named /></th>
      ${columns.map((column, k) => html`<td key=${k}>${column[name] ?? "–"}</td>`)}</tr>`)}</tbody></table>
    <div class="job-actions"><button type="button" class="tool" onClick=${onClose}>Close the comparison
      </button></div></div>`;
}

function shownFields(preset) {
  return Object.fromEntries(dotted(preset).map(([name, v]) => [name, fieldValue(v)]));
}

function latestRates(one, jobs) {
  const found = evaluations(one, jobs).reverse().flatMap((job) =>
    (job.result?.results ?? []).filter((row) => row.success).map((row) =>
      [`Success in ${job.spec.protocol}: ${row.name}`, format.interval(row.success)]));
  return Object.fromEntries(found);
}
