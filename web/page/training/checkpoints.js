// Active policy of the cell, and task planner of a sorting cell.
import { html, useCallback, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { get, inTurn } from "../api.js";
import * as format from "../format.js";
import { answers } from "../live/world-stream.js";
import { presetTitle } from "./fieldnames.js";
import { useItems } from "./formfields.js";

export const PAGE = 100;
const PER_JOB = 5;
const CHOOSING = "choosing tasks";
const REACHING = "reaching goals";
const SORTING = "sorting";

/** The newest checkpoints and all with an alias; `shipped` are the aliases that came with Tandem. */
export async function storedCheckpoints() {
  const [{ items }, aliases] = await Promise.all([get(`v1/checkpoints?limit=${PAGE}`), get("v1/aliases")]);
  const newest = new Set(items.map((one) => one.sha256));
  const older = new Map(aliases.items.map((one) => [one.checkpoint, one.name]).filter(([id]) => !newest.has(id)));
  const found = await Promise.allSettled([...older.values()].map((name) =>
    get(`v1/checkpoints/${encodeURIComponent(name)}`)));
  const names = aliases.items.filter((one) => one.shipped).map((one) => one.name);
  return [...items, ...found.flatMap(({ value }) => value ?? [])].map((one) =>
    ({ ...one, shipped: one.aliases.filter((name) => names.includes(name)) }));
}

/**
 * Known checkpoints, the error of the last request for them, and the ids of policies that act and are no longer
 * stored; asked for again when `stamp` changes and by `refresh`. Presets, whose titles name them, asked for again
 * for another `cell`: cells are choices.
 */
export function useCheckpoints(link, stamp, cell) {
  const presets = useItems(link, "v1/presets", cell);
  const [list, setList] = useState([]);
  const [error, setError] = useState(null);
  const [unstored, setUnstored] = useState([]);
  const [ask] = useState(() => inTurn(() => Promise.allSettled([
    storedCheckpoints().then((stored) => { setList(stored); setError(null); }, setError),
    get("v1/worlds").then(({ items }) => setUnstored(items.flatMap((one) => one.unstored))),
  ])));
  const refresh = useCallback(() => answers(link) && ask.run(), [link]);
  useEffect(() => void refresh(), [refresh, stamp]);
  return { list, error, unstored, presets, refresh };
}

export function Acting({ world, checkpoints, jobs, send }) {
  const now = world.checkpoint;
  const purpose = world.reach ? REACHING : CHOOSING;
  const groups = grouped(checkpoints.list.filter((c) => c.purpose === purpose), jobs, now);
  return html`<label class="acting">
    <span>Active policy</span>
    <select value=${now ?? ""} data-role="acting" aria-label="Checkpoint of the active policy"
      onFocus=${checkpoints.refresh} title=${world.policy_title ?? ""}
      onChange=${(e) => send({ tag: "set-policy", checkpoint: e.target.value || null })}>
      ${world.reach && html`<option value="">none: straight to the goal</option>`}
      ${!now && !world.reach && html`<option value="" disabled>none: choose one</option>`}
      ${options(groups, now, world.policy_title, checkpoints)}
    </select>
  </label>`;
}

/** Task planner: a sorting policy trained for this cell, or the exact planner. */
export function TaskPlanner({ sorting, cell, checkpoints, jobs, send }) {
  const now = sorting.sorting_policy;
  const mine = checkpoints.list.filter((c) => c.purpose === SORTING && c.manifest.cell === cell.name);
  const groups = grouped(mine, jobs, now);
  return html`<label class="sorting-policy"><span>Task planner</span>
    <select value=${now ?? ""} data-role="sorting-policy" onFocus=${checkpoints.refresh}
      onChange=${(e) => send({ tag: "set-sorting-policy", checkpoint: e.target.value || null })}>
      <option value="">the exact planner</option>
      ${options(groups, now, sorting.sorting_policy_title, checkpoints)}
    </select></label>`;
}

/** The checkpoints of groups, after the one that acts now if it is in none of them; the error of their request. */
function options(groups, now, title, { error, unstored, presets }) {
  const known = groups.some((g) => g.items.some((c) => c.sha256 === now));
  const state = unstored.includes(now) ? " · no longer stored" : "";
  return html`
    ${now && !known && html`<option value=${now}>${title ?? format.short(now)}${state}</option>`}
    ${groups.map((group) => html`<optgroup key=${group.label} label=${group.label}>
      ${group.items.map((c) => html`<option key=${c.sha256} value=${c.sha256}>
        ${name(c, group.job, presets)}</option>`)}</optgroup>`)}
    ${error && html`<option value="error" disabled>
      ${format.sentence(`The checkpoints could not be loaded: ${error.message}`)}</option>`}`;
}

/** Shipped checkpoints first, then uploaded ones, each job's newest few, and the active one. */
function grouped(list, jobs, now) {
  const byJob = new Map();
  for (const c of list.filter((one) => one.job_id)) {
    const items = byJob.get(c.job_id) ?? [];
    if (items.length < PER_JOB || c.sha256 === now) byJob.set(c.job_id, [...items, c]);
  }
  const groups = [
    { label: "Shipped", items: list.filter((c) => c.shipped.length), job: null },
    { label: "Uploaded", items: list.filter((c) => !c.job_id && !c.shipped.length), job: null },
  ].filter((group) => group.items.length);
  for (const [id, items] of byJob) {
    const job = `job ${jobs?.find((j) => j.id === id)?.number ?? format.short(id)}`;
    groups.push({ label: format.capital(job), items, job });
  }
  return groups;
}

function name(checkpoint, job, presets) {
  const { manifest = {} } = checkpoint;
  const preset = presetTitle(presets, checkpoint.preset ?? manifest.preset?.name);
  const step = checkpoint.step ?? manifest.step;
  const parts = [checkpoint.aliases[0] ?? job ?? preset ?? format.short(checkpoint.sha256)];
  if (!job && preset && preset !== parts[0]) parts.push(preset);
  if (Number.isFinite(step)) parts.push(format.count(step, "step"));
  return parts.join(" · ");
}
