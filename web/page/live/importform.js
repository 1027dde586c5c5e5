// Importing a recording: a file, what is stated about it, and how it was read.
import { html, useState } from "../vendor/htm-preact-standalone.module.js";
import { useAction } from "../action.js";
import { postFile } from "../api.js";
import * as format from "../format.js";
import { Icon } from "../icons.js";

const FORMATS = ".bvh,.mot,.sto,.csv";
const MAX_LISTED = 3;
const UNITS = ["m", "cm", "mm", "inch", "foot", "cmu"];
const UP_AXES = ["y", "z", "x", "-y", "-z", "-x"];
const NAMES_TITLE =
  "Joints or columns under names that are not known: theirs=ours, several separated by ;";
const NUMBER_TITLE = "A unit, or metres per unit as a number; found from the file if empty";

/** A button that picks a file, and behind it the form; `onDone` is called with what is stored. */
export function ImportForm({ onDone }) {
  const [file, setFile] = useState(null);
  const [stated, setStated] = useState({});
  const [motion, setMotion] = useState(null);
  const { busy, error, run, forget } = useAction((made) => {
    setMotion(made);
    setFile(null);
    onDone(made);
  });
  const state = (name) => (e) => setStated((now) => ({ ...now, [name]: e.target.value }));
  const choose = (e) => {
    setFile(e.target.files[0] ?? null);
    setStated({});
    setMotion(null);
    forget();
    e.target.value = ""; // so that the same file can be chosen again
  };
  const send = (e) => {
    e.preventDefault();
    const { names = "", ...others } = stated;
    const asked = [
      ["file_name", file.name],
      ...Object.entries(others).map(([name, value]) => [name, value.trim()]),
      ...names.split(";").map((pair) => ["map", pair.trim()]),
    ].filter(([, value]) => value);
    setMotion(null);
    run(() => postFile(`v1/recordings?${new URLSearchParams(asked)}`, file));
  };
  const skeleton = file?.name.toLowerCase().endsWith(".bvh");
  return html`<form class="dock-row import" onSubmit=${send} aria-label="Import a recording">
    <span class="dock-label">Import</span><div>
    <label class="tool" title="BVH, OpenSim or CSV, at most 32 MiB">
      <input class="sr" type="file" accept=${FORMATS} data-role="import-file"
        disabled=${busy} onChange=${choose} />
      <${Icon} name="plus" /><span>${file ? file.name : "Choose a file"}</span></label>
    ${skeleton && html`
      <datalist id="import-units">${UNITS.map((one) => html`<option key=${one} value=${one} />`)}
      </datalist>
      <label class="stated" title=${NUMBER_TITLE}>Unit
        <input data-role="import-unit" list="import-units" placeholder="found"
          value=${stated.unit ?? ""} onInput=${state("unit")} /></label>
      <label class="stated" title=${`Unit of the root's path, if another. ${NUMBER_TITLE}`}>Root
        <input data-role="import-root-unit" list="import-units" placeholder="same"
          value=${stated.root_unit ?? ""} onInput=${state("root_unit")} /></label>
      <label class="stated" title="Axis that points up; found from the file if empty">Up
        <select data-role="import-up" value=${stated.up ?? ""} onChange=${state("up")}>
          <option value="">found</option>
          ${UP_AXES.map((one) => html`<option key=${one} value=${one}>${one}</option>`)}
        </select></label>`}
    ${file && html`<label class="stated" title=${NAMES_TITLE}>Names
      <input class="names" data-role="import-names" placeholder="theirs=ours; …" spellcheck="false"
        value=${stated.names ?? ""} onInput=${state("names")} /></label>
    <button type="submit" class="tool" data-action="import"
      disabled=${busy}>${busy ? "Reading …" : "Import"}</button>`}
    ${error && html`<p class="field-error" role="alert" data-role="import-error">
      ${format.sentence(error.message)}</p>`}
    ${motion && html`<p class="result" role="status" data-role="import-result">
      ${summary(motion)}</p>`}
  </div></form>`;
}

/** The first frames that were cut out, and why. */
function cutOut(artifacts) {
  const listed = artifacts.slice(0, MAX_LISTED).map(({ first, last, reason }) =>
    `${first === last ? `frame ${first}` : `frames ${first} to ${last}`}: ${reason}`);
  return [...listed, ...(artifacts.length > MAX_LISTED ? ["…"] : [])].join("; ");
}

/** How a file was read, in sentences. */
function summary({ name, reading, n_runs: runs, n_artifacts: n, artifacts }) {
  if (!reading) return `${name} is stored already; an older version read it.`;
  const parts = [
    `${reading.unit}, ${reading.up} up`,
    reading.root_unit !== reading.unit && `root's path in ${reading.root_unit}`,
    `${format.number(reading.rate_hz, 4)} frames/s`,
    reading.stature !== null && `${format.length(reading.stature)} tall`,
    `${format.count(runs, "clean run")}, ${n} cut out${n ? ` (${cutOut(artifacts)})` : ""}`,
  ].filter(Boolean);
  return [`${name} read as: ${parts.join(", ")}.`, ...reading.notes.map(format.sentence)].join(" ");
}
