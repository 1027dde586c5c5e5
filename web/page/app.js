// Tandem's one page: the live cell, the value estimates of its targets, and training.
import { html, render, useEffect, useMemo, useRef, useState } from "./vendor/htm-preact-standalone.module.js";
import { Acting, useCheckpoints } from "./training/checkpoints.js";
import { Controls } from "./live/controls.js";
import { FirstUse } from "./firstuse.js";
import { capital, sentence } from "./format.js";
import { useFrameFocus } from "./framefocus.js";
import { Guard } from "./guard.js";
import { Close, Icon, Logo } from "./icons.js";
import { isActive } from "./training/jobactions.js";
import { useJobs } from "./training/jobs.js";
import { useCell, WORLD } from "./live/world-stream.js";
import { goalColours } from "./palette.js";
import { useMedia } from "./plots.js";
import { ReachDecision } from "./reach/reach.js";
import { SignIn } from "./signin.js";
import { SortingDecision } from "./sorting/sorting.js";
import { Safety } from "./live/safety.js";
import { SmallPrint, StatusPanel } from "./live/status.js";
import { Training } from "./training/training.js";
import { Values } from "./live/values.js";
import { Viewer } from "./viewer.js";
import { ViewMenu } from "./viewmenu.js";

const LINKS = {
  connecting: ["Connecting", "quiet"],
  warming: ["Warming up", "warn"],
  live: ["Live", "good"],
  stale: ["Stale", "bad"],
  stalled: ["Stalled", "bad"],
  lost: ["Disconnected", "bad"],
};

function App() {
  const cell = useCell();
  const { link, world } = cell;
  const { jobs, error, waiting, older, refresh } = useJobs(link);
  const active = (jobs ?? []).filter(isActive).length;
  const checkpoints = useCheckpoints(link, `${world?.checkpoint}:${stamp(jobs)}`, world?.cell);
  const [tab, setTab] = useTab();
  const roomy = useMedia("(min-width: 1760px)");
  const visited = useRef(false);
  visited.current ||= roomy || tab === "training";
  const acting = world?.checkpoint;
  const sortingPolicy = world?.sorting?.sorting_policy;
  const training = useMemo(() => {
    const act = ({ purpose, sha256 }) =>
      cell.send({ tag: purpose === "sorting" ? "set-sorting-policy" : "set-policy", checkpoint: sha256 });
    return html`<${Guard}><${Training} link=${link} jobs=${jobs} error=${error} waiting=${waiting}
      older=${older} refresh=${refresh} cell=${cell.cell?.name} presets=${checkpoints.presets}
      acting=${[acting, sortingPolicy]} onAct=${act} /></${Guard}>`;
  }, [link, jobs, error, waiting, older, acting, sortingPolicy, cell.cell?.name, checkpoints.presets]);
  if (link === "signin") return html`<${SignIn} />`;
  return html`<div class="frame" data-link=${link}>
    <header class="topbar">
      <h1 class="brand"><${Logo} />Tandem</h1>
      <${CellTitle} cell=${cell} />
      <span class="spacer"></span>
      ${world && html`<${Acting} world=${world} checkpoints=${checkpoints} jobs=${jobs}
        send=${cell.send} />`}
      <${Link} cell=${cell} />
      <a class="docs" href="docs" title="Documentation of the HTTP interface">API<${Icon} name="external" /></a>
    </header>
    ${cell.errors.length > 0 && html`<${Refusals} errors=${cell.errors} onDismiss=${cell.dismiss} />`}
    <${Stale} cell=${cell} />
    <main class="stage">
      <${Scene} cell=${cell} />
      <aside class="side" aria-label="Decision and training">
        <${Tabs} tab=${tab} onTab=${setTab} active=${active} />
        <div class="panel" id="panel-cell" role="tabpanel" aria-labelledby="tab-cell"
          data-hidden=${tab !== "cell"}><${Guard}><${Decision} cell=${cell}
            checkpoints=${checkpoints} jobs=${jobs} /></${Guard}></div>
        <div class="panel" id="panel-training" role="tabpanel" aria-labelledby="tab-training"
          data-hidden=${tab !== "training"}>
          ${visited.current && training}</div>
      </aside>
    </main>
  </div>`;
}

/** The cell's title; a choice where more than one can be shown live. */
function CellTitle({ cell: { cell, cells, show } }) {
  const [busy, setBusy] = useState(false);
  const shown = cells.filter((one) => one.lacks_for_live === null);
  if (!cell || shown.length < 2) return html`<span class="cell-title">${cell?.title ?? ""}</span>`;
  const change = async (event) => {
    setBusy(true);
    await show(event.target.value);
    setBusy(false);
  };
  return html`<label class="acting cell-title">
    <select value=${cell.name} data-role="cell" aria-label="Work cell that is shown"
      disabled=${busy} onChange=${change}>
      ${shown.map((one) => html`<option key=${one.name} value=${one.name}>${one.title}</option>`)}
    </select>
  </label>`;
}

function stamp(jobs) {
  return (jobs ?? []).map((j) => `${j.id}:${j.state}`).join(",");
}

/** Live, stale or what else; commands that wait longer than a moment are shown here. */
function Link({ cell: { link, world, heardAt, pending } }) {
  const waiting = useLate(pending > 0 && link === "live");
  const [text, tone] = waiting ? ["Waiting", "warn"] : LINKS[link];
  const seconds = useSeconds(heardAt, ["stale", "stalled"].includes(link) && world);
  return html`<span class=${`link ${tone}`} role="status" data-role="link"
    data-pending=${pending}><i></i><span>${text}${
    seconds !== null && html`<span aria-hidden="true"> for ${seconds} s</span>`}</span></span>`;
}

/** Each reason for which commands failed, with their number where it is not one. */
function Refusals({ errors, onDismiss }) {
  const counts = new Map();
  for (const { message } of errors) counts.set(message, (counts.get(message) ?? 0) + 1);
  return html`<div class="banner bad" role="alert"><${Icon} name="alert" />
    <div>${[...counts].map(([message, n]) => html`<p key=${message}>${sentence(message)}${
      n > 1 && ` (${n} commands)`}</p>`)}</div>
    <${Close} label="Dismiss" onClick=${onDismiss} /></div>`;
}

const CAUSES = {
  stale: "The server sends nothing.",
  stalled: "The server answers, but the cell has stopped.",
  lost: "The server does not answer; trying again every second.",
  warming: "The server starts again.",
};

/** Says that what is shown is old, how old, and what waits. */
function Stale({ cell: { link, reason, world, heardAt, pending, show } }) {
  const seconds = useSeconds(heardAt, link in CAUSES && world);
  if (seconds === null) return null;
  const waits = pending === 1 ? " 1 command is pending." : ` ${pending} commands are pending.`;
  return html`<p class="banner warn" role="alert" data-role="stale"><${Icon} name="alert" />
    <span><b>Stale<span aria-hidden="true"> for ${seconds} s</span>.</b> ${link === "lost" && reason
      ? again(reason) : CAUSES[link]} Scene and
    values show the last known state.${pending > 0 && waits}</span>
    ${link === "stalled" && html`<button type="button" class="tool" data-action="start-again"
      disabled=${pending > 0} onClick=${() => show(world.cell)}>Start the cell again</button>`}</p>`;
}

/** Whole seconds since `start`, counted on while `on`; null otherwise. */
function useSeconds(start, on) {
  const [now, setNow] = useState(0);
  useEffect(() => {
    if (!on) return undefined;
    setNow(performance.now());
    const timer = setInterval(() => setNow(performance.now()), 500);
    return () => clearInterval(timer);
  }, [Boolean(on)]);
  return on ? Math.max(0, Math.floor((Math.max(now, start) - start) / 1000)) : null;
}

/** True once `on` has held for half a second. */
function useLate(on) {
  const [late, setLate] = useState(false);
  useEffect(() => {
    const timer = setTimeout(() => setLate(on), on ? 500 : 0);
    return () => clearTimeout(timer);
  }, [on]);
  return on && late;
}

const ADDRESSES = { cell: "#decision", training: "#training" };

/** The open tab, which the address names: it stays when the page is loaded again, and the browser goes back to it. */
function useTab() {
  const named = () => (location.hash === ADDRESSES.training ? "training" : "cell");
  const [tab, setTab] = useState(named);
  useEffect(() => {
    const look = () => setTab(named());
    addEventListener("hashchange", look);
    return () => removeEventListener("hashchange", look);
  }, []);
  return [tab, (next) => {
    if (next !== tab) location.hash = ADDRESSES[next];
    setTab(next);
  }];
}

function Tabs({ tab, onTab, active }) {
  const tabs = [["cell", "Decision"], ["training", "Training"]];
  const move = (event) => {
    if (!["ArrowLeft", "ArrowRight"].includes(event.key)) return;
    const next = tab === "cell" ? "training" : "cell";
    onTab(next);
    document.getElementById(`tab-${next}`).focus();
  };
  return html`<div class="tabs" role="tablist" aria-label="Panels" onKeyDown=${move}>
    ${tabs.map(([id, label]) => html`<button key=${id} type="button" role="tab" id=${`tab-${id}`}
      aria-selected=${String(tab === id)} aria-controls=${`panel-${id}`}
      tabindex=${tab === id ? 0 : -1} onClick=${() => onTab(id)}>${label}
      ${id === "training" && active > 0 && html`<b class="count"
        aria-label=${`${active} running or waiting`}>${active}</b>`}</button>`)}
  </div>`;
}

function useGoals({ cell }) {
  const stations = cell?.stations ?? [];
  const labels = useMemo(() => new Map(stations.map((s) => [s.id, s.label])), [cell]);
  return {
    colourOf: useMemo(() => goalColours(stations), [cell]),
    labelOf: (id) => labels.get(id) ?? id,
  };
}

function Scene({ cell }) {
  const { link, world, epoch, reason } = cell;
  const goals = useGoals(cell);
  const frame = useRef(null);
  const keyed = useFrameFocus(frame);
  return html`<section class="hero" aria-label="The cell">
    <div class=${`viewer ${keyed ? "is-keyed" : ""}`}>
      ${epoch > 0 && html`<${Viewer} src=${`viewer/${WORLD}/`} epoch=${epoch} link=${link}
        frame=${frame} />`}
      ${world && html`<${FirstUse} world=${world} cell=${cell.cell} send=${cell.send} />`}
      ${epoch > 0 && world && html`<${ViewMenu} key=${epoch} frame=${frame} />`}
      ${!world && html`<div class="veil" role="status">
        <i class="spinner"></i>
        <p><b>${veil(link, reason)[0]}</b></p>
        <p class="faint">${veil(link, reason)[1]}</p>
      </div>`}
    </div>
    ${world && html`<${Controls} world=${world} cell=${cell.cell}
      cases=${cell.cell?.cases ?? []} send=${cell.send} ...${goals} />`}
  </section>`;
}

/** What the server says of its fault, and that the page asks again. */
function again(reason) {
  return `${sentence(reason)} Trying again every second.`;
}

function veil(link, reason) {
  if (link === "lost" && reason) return ["The cell cannot be shown", again(reason)];
  if (link === "lost" || link === "stale") return ["The server does not answer", "Trying again every second."];
  if (link !== "warming") return ["Opening the cell", ""];
  const doing = reason.replace(/^(warming up|starting):? */, "");
  if (doing === reason && reason) return ["The server is not ready", sentence(reason)];
  const patience = " The first start on a machine takes several minutes, later ones seconds.";
  return ["Warming up", `${capital(doing || "starting")} …${/compil/.test(doing) ? patience : ""}`];
}

function Decision({ cell, checkpoints, jobs }) {
  const goals = useGoals(cell);
  if (!cell.world) return html`<div class="skeleton tall" aria-busy="true"></div>`;
  if (cell.world.sorting && !cell.cell) return html`<${StatusPanel} world=${cell.world} /><${Safety} world=${cell.world} />`;
  if (cell.world.sorting) {
    return html`<${SortingDecision} world=${cell.world} cell=${cell.cell} send=${cell.send}
      checkpoints=${checkpoints} jobs=${jobs} />`;
  }
  if (cell.world.reach) return html`<${ReachDecision} world=${cell.world} />`;
  return html`<${StatusPanel} world=${cell.world} />
    <${Values} world=${cell.world} cell=${cell.cell} history=${cell.history} ...${goals} />
    <${Safety} world=${cell.world} />
    <${SmallPrint} world=${cell.world} />`;
}

const root = document.getElementById("app");
root.replaceChildren();
render(html`<${App} />`, root);
