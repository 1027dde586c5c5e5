// The training side: jobs with their curves, and the form that starts one.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { Icon } from "../icons.js";
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
        ${!form && jobs?.length > 0 && html`<button type="button" class="primary"
          data-action="new-job" onClick=${() => setForm({})}>
          <${Icon} name="plus" />New training job</button>`}</header>
      <${QueueWaits} waiting=${waiting} />
      <${JobList} jobs=${jobs} error=${error} open=${open ?? null} onOpen=${setOpen}
        onChanged=${refresh} onAct=${onAct} acting=${acting}
        onClone=${(job) => setForm({ from: job })}
        onNew=${form ? null : () => setForm({})} />
    </section>
  </div>`;
}
