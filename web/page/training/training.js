// The training side: jobs with their curves, and the form that starts one.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { Icon } from "../icons.js";
import { JobList, QueueWaits, isActive } from "./jobs.js";
import { TrainForm, usePresets } from "./trainform.js";

export function Training({ link, cell, jobs, error, waiting, refresh, acting, onAct }) {
  const presets = usePresets(link);
  const [form, setForm] = useState(false);
  const [open, setOpen] = useState(undefined);
  useEffect(() => {
    if (open === undefined && jobs?.length) setOpen((jobs.find(isActive) ?? jobs[0]).id);
  }, [jobs]);
  const started = (job) => {
    setForm(false);
    setOpen(job.id);
    refresh();
  };
  return html`<div class="training">
    ${form && html`<section class="card"><${TrainForm} ...${presets} cell=${cell} onStarted=${started}
      onClose=${() => setForm(false)} /></section>`}
    <section class="card" aria-labelledby="jobs-title">
      <header class="card-head"><h2 id="jobs-title">Jobs</h2>
        ${!form && jobs?.length > 0 && html`<button type="button" class="primary"
          data-action="new-job" onClick=${() => setForm(true)}>
          <${Icon} name="plus" />New training job</button>`}</header>
      <${QueueWaits} waiting=${waiting} />
      <${JobList} jobs=${jobs} error=${error} open=${open ?? null} onOpen=${setOpen}
        onChanged=${refresh} onAct=${onAct} acting=${acting}
        onNew=${form ? null : () => setForm(true)} />
    </section>
  </div>`;
}
