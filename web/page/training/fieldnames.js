// Fields of presets by their titles and units; a dotted name stays where it is typed, as a hint.
import { html } from "../vendor/htm-preact-standalone.module.js";
import * as format from "../format.js";

/** A preset's title; its name where no title is known. */
export function presetTitle(presets, name) {
  return presets?.items?.find((one) => one.name === name)?.title ?? name;
}

/** The preset of a name, else the first one that is for a cell or can be trained in it. */
export function presetFor(presets, name, cell) {
  return presets?.find((one) => one.name === name) ?? presets?.find((one) => one.cell === cell)
    ?? presets?.find((one) => shownCell(one, cell).cell) ?? presets?.[0] ?? null;
}

/** The cell that is shown as the field of a preset, where it can be trained in it. */
export function shownCell(preset, cell) {
  const field = preset?.fields.find(({ name }) => name === "cell");
  return field?.choices?.includes(cell) ? { cell } : {};
}

const OTHERS = { cell: "Work cell", kind: "Kind of job", purpose: "Purpose" };

/** Title and unit of a field by its dotted name; `preset` is where it is looked for first. */
export function fieldOf(presets, path, preset = null) {
  const known = presets?.items ?? [];
  const own = known.filter(({ name }) => name === preset);
  const field = [...own, ...known].flatMap(({ fields }) => fields)
    .find(({ name }) => `.${path}`.endsWith(`.${name}`));
  if (field && field.name !== "cell") return { title: field.title, unit: field.unit };
  const named = path.includes(" ") ? path : path.replaceAll("_", " ").replaceAll(".", ": ");
  return { title: OTHERS[path] ?? format.capital(named), unit: "" };
}

/** A field's title with its unit, and its dotted name as a hint, or below it with `named`. */
export function FieldName({ presets, path, preset, named = false }) {
  const { title, unit } = fieldOf(presets, path, preset);
  return html`<span title=${path}>${title}${unit && html`<span class="unit"> [${unit}]</span>`}</span>
    ${named && path.includes(".") && html`<code class="raw-name">${path}</code>`}`;
}

/** Names and values, and hints at the names; values that are unknown are left out. */
export function Facts({ entries }) {
  return html`<dl class="facts">${entries.filter(([, text]) => text !== "–").map(([name, text, hint]) => html`
    <div key=${hint ?? name}><dt title=${hint}>${name}</dt><dd>${text}</dd></div>`)}</dl>`;
}

/** Nested fields as pairs of a dotted name and a value. */
export function dotted(fields, prefix = "") {
  return Object.entries(fields ?? {}).flatMap(([key, value]) =>
    (value && typeof value === "object" && !Array.isArray(value)
      ? dotted(value, `${prefix}${key}.`) : [[`${prefix}${key}`, value]]));
}

/** A field's value; numbers with all their digits. */
export function fieldValue(v) {
  return v === null || v === undefined ? "–" : format.grouped(v);
}

/** Fields by their group, in order: pairs of the group's title and its fields. */
export function byGroup(fields) {
  const groups = new Map();
  for (const field of fields) {
    const group = format.capital(field.name.split(".")[0]);
    groups.set(group, [...(groups.get(group) ?? []), field]);
  }
  return [...groups];
}
