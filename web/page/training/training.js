// The training side: jobs with their curves, and the form that starts one.
import { html, useEffect, useLayoutEffect, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { Segmented } from "../choice.js";
import { Icon } from "../icons.js";
import { Comparison, MAX_JOBS } from "./compare.js";
import { CheckpointCards } from "./checkpointcards.js";
import { isActive } from "./jobactions.js";
import { JobList, QueueWaits, useOpened } from "./jobs.js";
import { EvaluateForm } from "./evaluateform.js";
import { useItems } from "./formfields.js";
import { useListFocus } from "../listfocus.js";
import { ReportForm } from "./reportform.js";
import { SweepForm } from "./sweepform.js";
import { TrainForm } from "./trainform.js";

const KINDS = { train: ["Training", TrainForm], evaluate: ["Evaluation", EvaluateForm],
  sweep: ["Sweep", SweepForm], report: ["Report", ReportForm] };

export function Training({ link, cell, presets, jobs: newest, error, waiting, older, refresh, acting, onAct }) {
  const protocols = useItems(link, "v1/protocols");
  const section = useListFocus();
  const [form, setForm] = useState(null);
  const had = useRef(null);
  useEffect(() => { // a form that was closed had the focus
    if (had.current && !form) document.querySelector('[data-action="new-job"]')?.focus();
    had.current = form;
  }, [form]);
  const [open, setOpen] = useState(undefined);
  const jobs = useOpened(newest, open, () => setOpen(null));
  useLayoutEffect(() => { // before any click: one on a job drawn closed would close it
    const own = jobs?.filter((job) => !job.part_of);
    if (open === undefined && own?.length) setOpen((own.find(isActive) ?? own[0]).id);
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
    ${form && html`<${NewJob} key=${form.from?.id} ...${{ link, presets, protocols, cell }} from=${form.from}
      onStarted=${started} onClose=${() => setForm(null)} />`}
    <section class="card" aria-labelledby="jobs-title" ref=${section}>
      <header class="card-head"><h2 id="jobs-title" tabindex="-1">Jobs</h2>
        <span class="spacer"></span>
        ${chosen && html`<button type="button" class="primary" data-action="show-comparison"
            disabled=${listed.length === 0} onClick=${() => setCompared(listed)}>
            Compare ${listed.length || ""}</button>
          <button type="button" class="tool" onClick=${() => setChosen(null)}>Done</button>`}
        ${!chosen && jobs?.length > 1 && html`<button type="button" class="tool"
          data-action="compare" onClick=${() => setChosen([])}>Compare …</button>`}
        ${!chosen && !form && jobs?.length > 0 && html`<button type="button" class="primary"
          data-action="new-job" onClick=${() => setForm({})}>
          <${Icon} name="plus" />New job</button>`}</header>
      ${chosen && html`<p class="field-help">Choose up to ${MAX_JOBS} jobs. Jobs that differ only in
        their seed share one curve with a band.</p>`}
      ${compared && html`<${Comparison} ids=${compared} presets=${presets}
        onClose=${() => setCompared(null)} />`}
      <${QueueWaits} waiting=${waiting} />
      <${JobList} ...${{ jobs, older, presets, protocols }} error=${error} open=${open ?? null} onOpen=${setOpen}
        onChanged=${refresh} onAct=${onAct} acting=${acting}
        chosen=${chosen} onChoose=${choose}
        onClone=${(job) => setForm({ from: job })}
        onNew=${form ? null : () => setForm({})} />
    </section>
    <${CheckpointCards} link=${link} jobs=${jobs} ...${{ acting, presets, protocols }} />
  </div>`;
}

/** The form of a new job: a choice of its kind, or a clone of a job, of the same kind. */
function NewJob({ from, ...rest }) {
  const section = useListFocus(".drawn:last-of-type select"); // where a drawn field has left
  const [kind, setKind] = useState(from?.kind ?? "train");
  const [, Form] = KINDS[kind];
  return html`<section class="card" aria-label="New job" ref=${section}>
    ${!from && html`<${Segmented} label="Kind of job" value=${kind} onPick=${setKind}
      items=${Object.entries(KINDS).map(([name, [label]]) => [name, label])}
      mark=${(name) => ({ "data-kind": name })} />`}
    <${Form} from=${from} ...${rest} /></section>`;
}
