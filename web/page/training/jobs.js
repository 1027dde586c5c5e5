// Jobs: the list, and for the open one its learning curves, numbers and what can be done.
import { html, useCallback, useEffect, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { Fault, useAction } from "../action.js";
import { follow, get, inTurn } from "../api.js";
import { answers } from "../live/world-stream.js";
import * as format from "../format.js";
import { Alert, Icon } from "../icons.js";
import { CurvePlot } from "../plots.js";
import { EndedByBudget } from "./budgets.js";
import { dotted, Facts, fieldOf, fieldValue, presetTitle } from "./fieldnames.js";
import { MAX_JOBS } from "./compare.js";
import { protocolTitle } from "./formfields.js";
import { isActive, JobFrame } from "./jobactions.js";
import { measuresOf } from "./measures.js";
import { Follow } from "./follow.js";
import { ReportDetail } from "./report.js";
import { SweepDetail } from "./sweep.js";
import { whileSeen } from "../visibility.js";

const POLL_MS = 2000;
const PAGE = 50;
const ACTIVE = ["queued", "running", "cancelling"]; // shown however many newer jobs there are
const LONGEST_PAGE = 200;
const MAX_PAGES = 10; // of one state
const MOST = LONGEST_PAGE * MAX_PAGES;
const TONES = { queued: "quiet", running: "accent", cancelling: "warn", succeeded: "good",
  failed: "bad", cancelled: "quiet" };
const OUTCOMES = [
  { key: "success", label: "success", colour: "good" },
  { key: "collision", label: "collision", colour: "bad" },
  { key: "timeout", label: "timeout", colour: "warn" },
];
const KINDS = { evaluate: "evaluation", sweep: "sweep" };
const UNITS = { evaluate: "rows", sweep: "trials", report: "evaluations" };
const SHA_256 = 64; // characters; a shorter name is an alias
const TURN = "Waiting for its turn.";
const REWARD = [{ key: "reward", label: "mean reward of an episode", colour: "accent" }];

/**
 * Newest jobs, asked for again every two seconds while the server is there; parts of others, too. `older`, where
 * ended ones are left out, says how many are shown and has `more`, which adds a page of them.
 */
export function useJobs(link) {
  const [state, setState] = useState({ jobs: null, error: null, waiting: null, older: null });
  const refresh = useRef(() => {});
  const pages = useRef(1);
  useEffect(() => {
    if (!answers(link)) return undefined;
    let over = false;
    const ask = inTurn(async () => {
      if (over) return;
      try {
        const [own, all] = await Promise.all([listed("", PAGE, pages.current), get("v1/jobs")]);
        const active = own.isWhole ? [] : await Promise.all(ACTIVE.map(inState));
        const found = [...own.items, ...all.items.filter((one) => one.part_of), ...active.flat()];
        const items = [...new Map(found.map((one) => [one.id, one])).values()];
        const older = own.isWhole ? null : { shown: own.items.length, more };
        if (!over) setState({ jobs: items.sort(byNumber), error: null, waiting: own.waiting, older });
      } catch (error) {
        if (!over) setState((now) => ({ ...now, error }));
      }
    });
    const more = () => {
      pages.current += 1;
      return ask.run();
    };
    refresh.current = ask.run;
    ask.run();
    const timer = setInterval(() => document.hidden || ask.isAsking() || ask.run(), POLL_MS);
    return () => {
      over = true;
      clearInterval(timer);
    };
  }, [link]);
  return { ...state, refresh: useCallback(() => refresh.current(), []) };
}

/** The jobs of a state that are part of none, up to MOST of them. */
async function inState(state) {
  return (await listed(`&state=${state}`, LONGEST_PAGE, MAX_PAGES)).items;
}

/** The first `n` pages of jobs that are part of none, whether these are all, and why none of them runs. */
async function listed(query, limit, n) {
  const items = [];
  let [cursor, waiting] = ["", null];
  for (let k = 0; k < n && cursor !== null; k += 1) {
    const after = cursor && `&cursor=${encodeURIComponent(cursor)}`;
    const page = await get(`v1/jobs?part_of=none${query}&limit=${limit}${after}`);
    items.push(...page.items);
    cursor = page.next_cursor || null;
    waiting = page.waiting;
  }
  return { items, isWhole: cursor === null, waiting };
}

/** The jobs with the open one, which may be older than they are; `onGone` if it was deleted. */
export function useOpened(jobs, id, onGone) {
  const [found, setFound] = useState(null);
  const missing = Boolean(id && jobs && !jobs.some((one) => one.id === id));
  useEffect(() => {
    if (!missing) return undefined;
    const stop = new AbortController();
    get(`v1/jobs/${id}`, { signal: stop.signal }).then(setFound,
      (error) => error.status === 404 && onGone());
    return () => stop.abort();
  }, [missing, id, jobs]);
  return missing && found?.id === id ? [...jobs, found].sort(byNumber) : jobs;
}

function byNumber(a, b) {
  return b.number - a.number;
}

const OTHER_SERVER = "another server runs the jobs";
const KEPT = "No progress is lost, and the jobs resume by themselves.";
const REMEDIES = {
  "disk full": `Free some space on the disk of the data folder. ${KEPT}`,
  "database locked": `Another program holds the database, such as a backup. ${KEPT}`,
  "database unavailable": `The database does not answer. ${KEPT}`,
  "database damaged": "Stop the server and restore a backup: python -m app restore FILE. What was stored since the "
    + "backup is lost.",
  "no free resources": `The machine can start no further process. ${KEPT}`,
  "disk error": "The disk of the data folder reports errors: check it. The jobs resume once it can be used.",
  "no Ray cluster": `They start as soon as the cluster answers. ${KEPT}`,
  "no free CPU in the Ray cluster": `They start as soon as a node has a free CPU. ${KEPT}`,
  [OTHER_SERVER]: "It holds the lease of the database; this server takes over once that one has ended.",
  "server unreachable": `A worker on another machine does not reach this server. ${KEPT}`,
};

/** Says why no job runs, and what happens to them. */
export function QueueWaits({ waiting }) {
  return waiting && html`<p class="notice warn" role="status" data-role="queue-waits">
    <${Icon} name="alert" /><span><b>${waiting === OTHER_SERVER ? format.sentence(waiting)
      : `Jobs are waiting: ${waiting}.`}</b> ${REMEDIES[waiting]}</span></p>`;
}

export function JobList({ jobs, error, older, onNew, ...rest }) {
  const fault = error
    && html`<${Alert}>${format.sentence(`The jobs could not be loaded: ${error.message}`)} Trying
      again every ${POLL_MS / 1000} s.</${Alert}>`;
  if (fault && !jobs) return fault;
  if (!jobs) return html`<div class="skeleton" aria-busy="true" aria-label="Loading jobs"></div>`;
  if (jobs.length === 0) {
    return html`<div class="empty">
      <p><b>No jobs yet.</b> A training job trains a policy from random weights.</p>
      ${onNew && html`<button type="button" class="primary" data-action="new-job" onClick=${onNew}>
        <${Icon} name="plus" />Start one</button>`}</div>`;
  }
  const listed = jobs.filter((job) => !job.part_of || job.id === rest.open || rest.chosen);
  const own = jobs.filter((job) => !job.part_of).length;
  return html`${fault}<ul class="jobs">
    ${listed.map((job) => html`<${Job} key=${job.id} job=${job} jobs=${jobs} ...${rest}
      open=${rest.open === job.id} />`)}
  </ul>
  ${older && html`<p class="faint list-end">
    ${`The newest ${older.shown} are shown, and older ones that have not ended${
      own >= MOST ? `, up to ${MOST} of a state` : ""}.`}
    ${" "}<button type="button" class="text-button" data-action="older-jobs"
      onClick=${older.more}>Show ${PAGE} more</button></p>`}`;
}

function Job({ job, jobs, open, chosen, onChoose, ...rest }) {
  const share = job.progress ?? 0;
  const [kind, raw] = [kindOf(job, rest), job.preset ?? job.spec?.protocol];
  const title = titleOf(job, kind);
  return html`<li class=${`job ${open ? "is-open" : ""} ${chosen ? "has-choice" : ""}`} data-job=${job.id}
    data-state=${job.state}>
    ${chosen && html`<label class="job-choice"><input type="checkbox" checked=${chosen.includes(job.id)}
      data-role="compare" aria-label=${`Compare ${title}`}
      disabled=${chosen.length >= MAX_JOBS && !chosen.includes(job.id)}
      onChange=${() => onChoose(job.id)} /></label>`}
    <button type="button" class="job-head" aria-expanded=${String(open)}
      onClick=${() => rest.onOpen(open ? null : job.id)}>
      <${Icon} name="chevron" />
      <span class="job-name" title=${raw ? `${title} (${raw})` : title}>${title}</span>
      <span class=${`chip chip-${job.waiting ? "warn" : TONES[job.state] ?? "quiet"}`}>${
        job.waiting ? `waiting: ${job.waiting}` : stateOf(job)}</span>
      <span class="job-sub">${subtitle(job, jobs, kind)}</span>
    </button>
    ${isActive(job) &&
    html`<div class="progress" role="progressbar" aria-label=${`Progress of ${title}`}
      aria-valuemin="0" aria-valuemax="100" aria-valuenow=${Math.round(share * 100)}>
      <i style=${{ transform: `scaleX(${share})` }}></i></div>`}
    ${open && html`<${DETAILS[job.kind] ?? JobDetail} job=${job} ...${rest} />`}
  </li>`;
}

const DETAILS = { evaluate: Evaluation, sweep: SweepDetail, report: ReportDetail };

function stateOf(job) {
  return job.ended_by ? `${job.state}: ${job.ended_by}` : job.state;
}

/** What a job trains or evaluates. */
function kindOf({ preset, spec, kind }, { presets, protocols }) {
  return preset ? presetTitle(presets, preset) : protocolTitle(protocols.items, spec?.protocol) ?? format.capital(kind);
}

function titleOf(job, kind) {
  return `${job.number === undefined ? format.short(job.id) : `Job ${job.number}`} · ${job.name ?? kind}`;
}

function subtitle(job, jobs, kind) {
  const parts = [`seed ${job.seed}`];
  if (job.name) parts.unshift(kind);
  if (job.kind in KINDS) parts.unshift(KINDS[job.kind]);
  const parent = job.parent && jobs.find(({ id }) => id === job.parent);
  if (parent) parts.push(`from job ${parent.number}`);
  if (job.state === "queued" && job.priority) parts.push(`priority ${format.number(job.priority)}`);
  const unit = UNITS[job.kind] ?? "steps";
  const last = lastStep(job);
  if (isActive(job) && last) {
    const budget = last < job.total_steps ? " (budget)" : "";
    parts.push(`${format.steps(job.step)} of ${format.count(last, unit.slice(0, -1))}${budget}`);
    if (job.state === "running" && job.kind === "train") {
      const left = job.time_left_s;
      if (Number.isFinite(left)) parts.push(`${format.duration(left)} left`);
      else if (job.latest) parts.push("collecting");
    }
  } else {
    if (job.step) parts.push(format.count(job.step, unit.slice(0, -1)));
    parts.push(format.ago(job.finished_at ?? job.created_at));
  }
  if (job.attempt > 1) parts.push(`attempt ${job.attempt}`);
  if (job.kills) parts.push(`killed ${job.kills === 1 ? "once" : format.count(job.kills, "time")}`);
  return parts.join(" · ");
}

/** The step at which a job ends: its last one, or that of its budget. */
function lastStep(job) {
  return job.total_steps && Math.min(job.total_steps, job.step_budget ?? Infinity);
}

function JobDetail({ job, presets, onChanged, onOpen, onClone, onAct, acting }) {
  const { rows, checkpoint, lost } = useCurve(job, onChanged);
  const [at, setAt] = useState(null);
  const row = rows?.[at ?? rows.length - 1] ?? null;
  const readout = at !== null && at !== undefined && row;
  const actions = html`
    ${checkpoint && html`<${Act} job=${job} newest=${checkpoint} acting=${acting} onAct=${onAct} />`}
    ${job.kind === "train" && html`<${Follow} job=${job} />`}`;
  return html`<${JobFrame} ...${{ job, actions, onChanged, onOpen, onClone }}>
    ${!rows && html`<div class="skeleton tall" aria-busy="true" aria-label="Loading the curve"></div>`}
    ${rows && rows.length === 0 && html`<p class="empty">${job.state === "queued"
      ? TURN
      : isActive(job) ? "Warming up; the first point comes after the first episodes."
        : "It ended before its first point: retry it, or clone it with changes."}</p>`}
    ${rows && rows.length > 0 && html`
      <${Legend} lines=${OUTCOMES} row=${row} show=${(v) => rate(v, row?.episodes)} />
      <${CurvePlot} rows=${rows} lines=${OUTCOMES} height=${168} unit="%" range=${[0, 1]}
        sync=${job.id} onHover=${setAt}
        label=${`Success, collision and timeout rate over environment steps, ${
          format.count(rows.length, "point")}`} />
      <${Legend} lines=${REWARD} row=${row} show=${(v) => format.number(v)} />
      <${CurvePlot} rows=${rows} lines=${REWARD} height=${112} sync=${job.id} onHover=${setAt}
        label="Mean reward over environment steps" />
      <p class="plot-foot"><span data-points=${rows.length}>Environment steps,
        ${` ${format.count(rows.length, "point")}`}</span>
        <span data-role="point">${row && `${readout ? "" : "last: "}${format.count(row.step, "step")},
          ${format.count(row.episodes ?? 0, "episode")}`}</span></p>`}
    ${job.ended_by?.endsWith("budget") && html`<${EndedByBudget} key=${job.attempt} job=${job} onChanged=${onChanged} />`}
    ${lost && html`<p class="notice warn" role="status"><${Icon} name="alert" />
      The connection to this job was lost; trying again.</p>`}
    <${Speed} job=${job} row=${rows?.at(-1)} presets=${presets} />
  </${JobFrame}>`;
}

/** Lets the job's newest checkpoint act: which one that is, the server says at the click. */
function Act({ job, newest, acting, onAct }) {
  const [loaded, setLoaded] = useState(null);
  const { error, run } = useAction(setLoaded);
  const act = () => run(async () => {
    const { items } = await get(`v1/checkpoints?job_id=${job.id}&limit=1`);
    if (items.length === 0) throw new Error("its checkpoints are gone");
    await onAct(items[0]);
    return items[0];
  });
  const acts = loaded && acting.includes(loaded.sha256);
  return html`<button type="button" class="tool" data-action="act"
      disabled=${acting.includes(newest) && !isActive(job)} onClick=${act}>
      ${acts && isActive(job) ? "Load its newest checkpoint" : "Deploy to cell"}</button>
    ${acts && html`<span class="faint" role="status" data-role="acts">Deployed,
      with ${format.count(loaded.step, "step")}.</span>`}
    <${Fault} error=${error} />`;
}

/** A rate of a point, with its interval where it is known of how many episodes. */
function rate(v, n) {
  return Number.isFinite(v) && n > 0 ? format.interval(format.wilson(v, n)) : "–";
}

/** An evaluation has no curve: its rows, once all are known. */
function Evaluation({ job, ...rest }) {
  const { checkpoint, episodes } = job.spec;
  const rows = job.result?.results ?? [];
  return html`<${JobFrame} job=${job} ...${rest}>
    <${Facts} entries=${[["Checkpoint", checkpoint?.length === SHA_256 ? format.short(checkpoint) : checkpoint ?? "–"],
      ["Episodes", fieldValue(episodes)]]} />
    ${rows.length === 0 && !job.error && html`<p class="empty">${job.state === "queued"
      ? TURN
      : isActive(job) ? "The rows are shown once all are known."
        : "It ended without a result: retry it."}</p>`}
    ${rows.length > 0 && html`<dl class="rows" data-role="rows">${rows.map((row) => html`
      <div key=${row.name}><dt>${row.name} <small>n = ${row.n}</small></dt>
        ${measuresOf(row).map(([label, text]) => html`<dd key=${label}><span>${label}</span>
          <b>${text}</b></dd>`)}
      </div>`)}</dl>
      <p class="plot-foot"><span>In brackets: 95 % intervals</span></p>`}
  </${JobFrame}>`;
}

function Legend({ lines, row, show }) {
  return html`<p class="legend">${lines.map((l) => html`<span key=${l.key}>
    <i class=${`line-mark ${l.colour}`}></i>${l.label}<b>${show(row?.[l.key])}</b></span>`)}</p>`;
}

function Speed({ job, row, presets }) {
  const changed = dotted(job.overrides);
  const shown = (name, v) => {
    const { title, unit } = fieldOf(presets, name, job.preset);
    return [title, [fieldValue(v), unit].filter(Boolean).join(" "), name];
  };
  return html`${row && html`<${Facts} entries=${[
      ["Updates", format.steps(row.updates)],
      ["Updates per s", format.number(row.updates_per_s)],
      ["Steps per s", format.steps(row.steps_per_s)],
      ["CPU time", format.duration(row.cpu_s)],
      ["Step budget", format.steps(job.step_budget)],
      ["Time budget", job.time_budget_s === null ? "–"
        : `${format.duration(job.run_s)} of ${format.duration(job.time_budget_s)}`],
    ]} />`}
    ${changed.length > 0 && html`<h3 class="facts-title">Changed fields</h3>
      <${Facts} entries=${changed.map(([name, v]) => shown(name, v))} />`}`;
}

/** The curve of one job: what is stored, then what its event stream adds. */
function useCurve(job, onChanged) {
  const [state, setState] = useState({ rows: null, checkpoint: null, lost: false });
  const changed = useRef(onChanged);
  changed.current = onChanged;
  const known = useRef(null);
  useEffect(() => {
    if (known.current?.job !== job.id) {
      known.current = { job: job.id, points: new Map(), checkpoint: null, lastId: "" };
      setState({ rows: null, checkpoint: null, lost: false });
    }
    let { points, checkpoint } = known.current;
    const show = () => setState({ checkpoint, lost: false,
      rows: [...points.values()].sort((a, b) => a.step - b.step) });
    const onEvent = (name, data, id) => {
      if (name === "progress") points.set(data.step, data);
      else if (name === "checkpoint") checkpoint = data.sha256 ?? checkpoint;
      else if (name === "state") {
        if (Number.isFinite(data.resumed_from_step)) {
          points = new Map([...points].filter(([step]) => step <= data.resumed_from_step));
        }
        changed.current();
      }
      Object.assign(known.current, { points, checkpoint, lastId: id || known.current.lastId });
      schedule();
    };
    let frame = 0;
    const schedule = () => {
      frame = frame || requestAnimationFrame(() => {
        frame = 0;
        show();
      });
    };
    const stop = whileSeen(() => follow(`v1/jobs/${job.id}/events`, {
      onEvent,
      onUp: schedule,
      onDown: () => setState((now) => ({ ...now, lost: true })),
      lastId: known.current.lastId,
    }));
    return () => {
      stop();
      cancelAnimationFrame(frame);
    };
  }, [job.id, job.attempt]); // the stream ends with the job; a resumed one has another attempt
  return state;
}
