// The training side: jobs with their curves, and the form that starts one.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { Icon } from "../icons.js";
import { Comparison, MAX_JOBS } from "./compare.js";
import { CheckpointCards } from "./checkpointcards.js";
import { isActive } from "./jobactions.js";
import { JobList, QueueWaits } from "./jobs.js";
import { TrainForm, usePresets } from "./trainform.js";

export function Training({ link, cell, jobs, error, waiting, refresh, acting, onAct }) {
  const presets = usePresets(link);
  const [form, setForm] = useState(null);
  const [open, setOpen] = useState(undefined);
  useEffect(() => {
    if (open === undefined && jobs?.length) setOpen((jobs.find(isActive) ?? jobs[0]).id);
  }, [jobs]);
  const [chosen, setChosen] = useState(null);
  const [compared, setCompared] = useState(null);
  const listed = jobs?.filter(({ id }) => chosen?.includes(id)).map(({ id }) => id).reverse() ?? [];
  const choose = (id) => setChosen((now) =>
    now.includes(id) ? now.filter((one) => one !== id) : [...now, id]);
  const started = (job) => {
    setForm(null);
    setOpen(job.id);
    refresh();
  };
  return html`<div class="training">
    ${form && html`<section class="card"><${TrainForm} key=${form.from?.id} ...${presets}
      cell=${cell} from=${form.from} onStarted=${started} onClose=${() => setForm(null)} /></section>`}
    <section class="card" aria-labelledby="jobs-title">
      <header class="card-head"><h2 id="jobs-title">Jobs</h2>
        <span class="spacer"></span>
        ${chosen && html`<button type="button" class="primary" data-action="show-comparison"
            disabled=${listed.length === 0} onClick=${() => setCompared(listed)}>
            Compare ${listed.length || ""}</button>
          <button type="button" class="tool" onClick=${() => setChosen(null)}>Done</button>`}
        ${!chosen && jobs?.length > 1 && html`<button type="button" class="tool"
          data-action="compare" onClick=${() => setChosen([])}>Compare …</button>`}
        ${!chosen && !form && jobs?.length > 0 && html`<button type="button" class="primary"
          data-action="new-job" onClick=${() => setForm({})}>
          <${Icon} name="plus" />New training job</button>`}</header>
      ${chosen && html`<p class="field-help">Choose up to ${MAX_JOBS} jobs. Jobs that differ only in
        their seed share one curve with a band.</p>`}
      ${compared && html`<${Comparison} ids=${compared} onClose=${() => setCompared(null)} />`}
      <${QueueWaits} waiting=${waiting} />
      <${JobList} jobs=${jobs} error=${error} open=${open ?? null} onOpen=${setOpen}
        onChanged=${refresh} onAct=${onAct} acting=${acting}
        chosen=${chosen} onChoose=${choose}
        onClone=${(job) => setForm({ from: job })}
        onNew=${form ? null : () => setForm({})} />
    </section>
    <${CheckpointCards} link=${link} jobs=${jobs} acting=${acting} />
  </div>`;
}
