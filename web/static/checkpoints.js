// Which checkpoint acts in the cell.
import { html, useEffect, useState } from "./vendor/htm-preact-standalone.module.js";
import { get } from "./api.js";
import * as format from "./format.js";

/** Known checkpoints; asked for again when `stamp` changes. */
export function useCheckpoints(link, stamp) {
  const [list, setList] = useState([]);
  useEffect(() => {
    if (link !== "live") return;
    get("/v1/checkpoints?limit=100").then(
      (page) => setList(page.items ?? page.checkpoints ?? page), () => {});
  }, [link, stamp]);
  return list;
}

export function Acting({ world, checkpoints, jobs, send }) {
  const now = world.checkpoint;
  const known = checkpoints.some((c) => c.sha256 === now);
  return html`<label class="acting">
    <span>Acting</span>
    <select value=${now ?? ""} data-role="acting" aria-label="Checkpoint that acts in the cell"
      onChange=${(e) => send({ tag: "set-policy", checkpoint: e.target.value })}>
      ${!now && html`<option value="" disabled>no policy</option>`}
      ${now && !known && html`<option value=${now}>${world.policy_title ?? format.short(now)}</option>`}
      ${checkpoints.map((c) => html`<option key=${c.sha256} value=${c.sha256}>
        ${name(c, jobs)}</option>`)}
    </select>
  </label>`;
}

function name(checkpoint, jobs) {
  const preset = checkpoint.preset ?? checkpoint.manifest?.preset ?? "";
  const step = checkpoint.step ?? checkpoint.manifest?.step;
  const alias = checkpoint.aliases?.[0];
  const job = jobs?.find((j) => j.id === checkpoint.job_id);
  const origin = alias ?? (job ? `job ${job.number ?? format.short(job.id)}` : preset);
  const parts = [origin || format.short(checkpoint.sha256)];
  if (alias && preset && preset !== alias) parts.push(preset);
  if (Number.isFinite(step)) parts.push(`${format.steps(step)} steps`);
  return parts.join(" · ");
}
