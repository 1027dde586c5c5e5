// The people in the cell: who is there, who moves each, what is played, how large each is.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { Segmented } from "../choice.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";
import { ImportForm } from "./importform.js";
import { VESTS } from "../palette.js";
import { useAnswer } from "../training/formfields.js";
import { PedestrianControls, RemovePerson } from "./walkers.js";

const MAX_PEOPLE = 4;
const MODES = [
  ["manual", "Manual", "You drag the handles in the scene", "hand"],
  ["auto", "Work cycle", "Reaches for cubes and docks, again and again", "walk"],
  ["recorded", "Recording", "Plays a recording of human motion", "film"],
  ["still", "Idle", "Goes home and rests", "stand"],
];
const SLIDERS = [
  ["stature", "Stature", (body) => format.length(body.stature_m)],
  ["arms", "Arms", (body) => format.length(body.arm_m)],
  ["shoulders", "Shoulders", (body) => format.length(body.shoulders_m)],
];
const PERCENTILES = [1, 99];
const SEND_MS = 150;

export const nameOf = (id) => `Person ${id + 1}`;

/** Two rows: everyone with the clock beside them, and the one who is picked. */
export function People({ world, send, children }) {
  const people = world.people ?? [];
  const [picked, setPicked] = useState(0);
  const person = people.find((one) => one.id === picked) ?? people[0] ?? null;
  const [sized, setSized] = useState(false);
  return html`<div class="dock-row">
      <span class="dock-label" id="people-label">People</span>
      <div class="people" role="group" aria-labelledby="people-label">
        ${people.map(({ id }) => html`<button key=${id} type="button" class="goal who"
          aria-pressed=${String(id === person?.id)} data-person=${id}
          onClick=${() => setPicked(id)}>
          <i class="swatch" style=${{ background: VESTS[id] }}></i>${nameOf(id)}</button>`)}
        ${people.length < MAX_PEOPLE && html`<button type="button" class="goal add"
          data-action="add-person" title="A further person enters the cell" onClick=${() => send({ tag: "add-person" })}>
          <${Icon} name="plus" />Add</button>`}
      </div>
      <${Observed} people=${people} most=${world.observed_people} />
      <span class="spacer"></span>
      ${children}
    </div>
    ${!person && html`<div class="dock-row"><span class="dock-label"></span>
      <p class="dock-note">No person is in the cell: add one to see the robot avoid people.</p></div>`}
    ${person?.cylinder && html`<${PedestrianControls} key=${person.id} person=${person}
      name=${nameOf(person.id)} world=${world} send=${send} />`}
    ${person && !person.cylinder && html`<${MotionSource} key=${person.id} person=${person} send=${send}
      sized=${sized} onSized=${() => setSized(!sized)} />`}
    ${person && !person.cylinder && sized && html`<${Size} key=${`size-${person.id}`} person=${person} send=${send} />`}`;
}

/** Which people the policy observes, where it does not observe all. */
function Observed({ people, most }) {
  if (most === null || people.length <= most) return null;
  const nearest = people.find((one) => one.nearest);
  return most === 1
    ? html`<p class="dock-hint" title="This policy observes one person: the nearest to the robot">
      Observed: ${nameOf(nearest.id)}</p>`
    : html`<p class="dock-hint" title="This policy observes the person nearest to the robot and, of the others, the one nearest to the target">
      Observed: ${most} of ${people.length}</p>`;
}

/** Who moves a person; with a recording, which one and how far it is. */
function MotionSource({ person, send, sized, onSized }) {
  const { id, mode } = person;
  const [open, setOpen] = useState(false);
  const { answer, error, refresh } = useAnswer("v1/recordings");
  const list = error ? null : answer?.items ?? null;
  const playing = mode === "recorded";
  const shown = playing || open;
  useEffect(() => {
    if (shown) refresh();
  }, [shown, refresh]);
  useEffect(() => {
    if (playing) setOpen(false);
  }, [playing]);
  const pick = (wanted) => {
    setOpen(wanted === "recorded");
    if (wanted !== "recorded") send({ tag: "set-mode", person: id, mode: wanted });
    else if (list?.length && !playing) send(playOf(id, list[0].name));
    else refresh();
  };
  return html`<div class="dock-row dock-wrap">
      <span class="dock-label" id="mode-label">Motion source</span>
      <${Segmented} labelledby="mode-label" value=${open && !playing ? "recorded" : mode}
        items=${MODES} onPick=${pick} mark=${(one) => ({ "data-mode": one })} />
      ${mode === "manual" && !open && html`<p class="dock-hint">Drag the handles in the scene.</p>`}
      <span class="spacer"></span>
      <div class="transport" role="group" aria-label=${`${nameOf(id)} in the cell`}>
        <button type="button" class="tool" aria-expanded=${String(sized)} data-action="size"
          aria-label="Size" title="Stature, arms and shoulders of this person" onClick=${onSized}><${Icon} name="ruler" /><span>Size</span></button>
        <${RemovePerson} person=${id} name=${nameOf(id)} send=${send} />
      </div>
    </div>
    ${shown && html`<${Recording} person=${person} list=${list} error=${error} onAgain=${refresh} send=${send} />
      <${ImportForm} onDone=${refresh} />`}`;
}

/** Stored recordings to choose from, and the one that plays. */
function Recording({ person, list, error, onAgain, send }) {
  const { id, motion } = person;
  if (error) return html`<${Note}>${format.sentence(`The recordings could not be listed: ${error.message}`)}
      ${" "}<button type="button" class="text-button" onClick=${onAgain}>Try again</button></${Note}>`;
  if (list === null) return html`<${Note}>Looking for recordings …</${Note}>`;
  if (list.length === 0 && !motion) {
    return html`<${Note} role="empty-motions">No recordings yet. Import one here, or with
      ${" "}<code>python -m app recordings import FILE --keep</code>.</${Note}>`;
  }
  const known = list.some((one) => one.name === motion?.name);
  return html`<div class="dock-row recording">
    <span class="dock-label" id="motion-label">Recording</span>
    <select aria-labelledby="motion-label" data-role="motion" value=${motion?.name ?? ""}
      onChange=${(e) => send(playOf(id, e.target.value))}>
      ${!motion && html`<option value="" disabled>Choose one</option>`}
      ${motion && !known && html`<option value=${motion.name}>${motion.name} (removed)</option>`}
      ${list.map((one) => html`<option key=${one.name} value=${one.name}>
        ${one.name} (${format.seconds(one.duration_s)})</option>`)}
    </select>
    ${motion && motion.n_runs > 1 && html`<select aria-label="Run of the recording"
      data-role="run" value=${motion.run} disabled=${!known}
      onChange=${(e) => send(playOf(id, motion.name, Number(e.target.value)))}>
      ${Array.from({ length: motion.n_runs }, (_, run) => html`<option key=${run} value=${run}>
        run ${run + 1} of ${motion.n_runs}</option>`)}
    </select>`}
    ${motion && html`<${Progress} person=${person} motion=${motion} />`}
  </div>`;
}

function Progress({ person, motion }) {
  const share = motion.duration_s > 0 ? Math.min(1, motion.t_s / motion.duration_s) : 0;
  const notes = [
    person.outside_area && "Outside the walking area now.",
    motion.outside_share > 0.001 &&
      `${percent(motion.outside_share)} of the path leaves the walking area.`,
    motion.clipped_share > 0.001 &&
      `${percent(motion.clipped_share)} of the frames bend a joint beyond the model's limit; the
      policy observes the limit, with a wrist up to ${format.length(motion.clipped_m)} off.`,
  ].filter(Boolean);
  return html`<span class="played"><i style=${{ transform: `scaleX(${share})` }}></i></span>
    <span class="played-text" data-role="progress">${person.joining
      ? "on the way to the start"
      : `${motion.t_s.toFixed(1)} of ${format.seconds(motion.duration_s)}`}</span>
    ${notes.length > 0 && html`<span class="hint" tabindex="0" data-role="motion-notes">
      ${person.outside_area ? "outside the area" : "notes"}
      <span class="tip" role="tooltip">${notes.join(" ")}</span></span>`}`;
}

/** Sliders in percentiles of adults, with the centimetres they come to. */
function Size({ person, send }) {
  const { id, anthropometry: body, mode } = person;
  const [local, setLocal] = useState({});
  // What was set holds until its command has ended, also one that failed.
  const change = useThrottled(async (name, value) => {
    await send({ tag: "set-anthropometry", person: id, [name]: value });
    setLocal((now) => Object.fromEntries(
      Object.entries(now).filter((one) => one[0] !== name || one[1] !== value)));
  });
  const recorded = body.recorded && Object.keys(local).length === 0;
  return html`<div class="dock-row sizes">
    <span class="dock-label" title="P95: percentile 95 of adults">Size</span>
    ${SLIDERS.map(([name, label, shown]) => html`<label key=${name} class="size" data-size=${name}>
      <span><span>${label}${recorded ? "" : ` P${Math.round(local[name] ?? body[name])}`}</span>
        <b data-role=${`${name}-text`}>${shown(body)}</b></span>
      <input type="range" min=${PERCENTILES[0]} max=${PERCENTILES[1]} step="1"
        class=${recorded ? "is-idle" : ""}
        value=${local[name] ?? body[name]}
        aria-label=${`${label}, percentile of adults`}
        aria-valuetext=${`percentile ${Math.round(local[name] ?? body[name])}, ${shown(body)}`}
        onInput=${(e) => {
          const value = Number(e.target.value);
          setLocal((now) => ({ ...now, [name]: value }));
          change(name, value);
        }} /></label>`)}
    ${mode === "recorded" && html`<button type="button" class="tool" aria-pressed=${String(recorded)}
      data-action="recorded-size" title="Take the lengths of the person who was recorded"
      onClick=${() => {
        setLocal({});
        send({ tag: "set-anthropometry", person: id, recorded: !recorded });
      }}>${recorded ? html`<${Icon} name="check" />` : ""}As recorded</button>`}
  </div>`;
}

function Note({ children, role }) {
  return html`<div class="dock-row"><span class="dock-label">Recording</span>
    <p class="dock-note" data-role=${role}>${children}</p></div>`;
}

/** Calls `act(name, value)` at most every SEND_MS, and with each name's last value in the end. */
function useThrottled(act) {
  const [gate] = useState(() => ({ timer: null, waiting: new Map(), act }));
  gate.act = act;
  const flush = () => {
    const waiting = [...gate.waiting];
    gate.waiting.clear();
    gate.timer = waiting.length ? setTimeout(flush, SEND_MS) : null;
    waiting.forEach(([name, value]) => gate.act(name, value));
  };
  return (name, value) => {
    gate.waiting.set(name, value);
    if (gate.timer === null) flush();
  };
}

function playOf(person, name, run = 0) {
  return { tag: "set-motion", person, name, run };
}

function percent(share) {
  return share < 0.01 ? "Less than 1 %" : format.percent(share, 0);
}
