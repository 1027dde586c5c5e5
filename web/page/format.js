// Numbers and names as people read them: one rule for each kind of quantity. SI units come in.

import { serverTime } from "./api.js";

const MINUS = "\u2212";
const NB = "\u00a0"; // no line ends between a number and its unit
const DAY_S = 24 * 3600;

/** A finite number; null for anything else. */
export function finite(v) {
  return Number.isFinite(v) ? v : null;
}

/** A critic's value with two decimals and a true minus sign. */
export function value(v) {
  if (!Number.isFinite(v)) return "–";
  const text = Math.abs(v).toFixed(2);
  return v < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/**
 * A length in metres with two decimals, in millimetres below 1 cm; the same rule as
 * `length_text` in app/live/status_messages.py.
 */
export function length(metres) {
  if (!Number.isFinite(metres)) return "–";
  const mm = Math.round(metres * 1000);
  if (mm >= 10) return `${metres.toFixed(2)}${NB}m`;
  if (mm > 0) return `${mm}${NB}mm`;
  return metres === 0 ? `0${NB}m` : `<${NB}1${NB}mm`;
}

/** The distance of a person from the robot, in metres; contact where nothing is between them. */
export function gap(metres) {
  return metres !== null && metres <= 0 ? "contact" : length(metres);
}

/** A count of steps: 950, 12.4 k, 1.25 M. */
export function steps(n) {
  if (n === null || n === undefined) return "–";
  if (n >= 999_950) return `${trim((n / 1e6).toFixed(2))}${NB}M`;
  if (n >= 1e4) return `${trim((n / 1e3).toFixed(1))}${NB}k`;
  return String(Math.round(n));
}

/** A count with its noun: 1 step, 12.4 k steps. */
export function count(n, one, many = `${one}s`) {
  return `${steps(n)} ${n === 1 ? one : many}`;
}

/** Events per hour, of `n` in `t` seconds; a dash in the first minute. */
export function perHour(n, t) {
  return t >= 60 ? `${number((n / t) * 3600)}${NB}/${NB}h` : "–";
}

/** A rate in [0, 1] as percent. */
export function percent(rate, digits = 1) {
  if (!Number.isFinite(rate)) return "–";
  return `${(rate * 100).toFixed(digits)}${NB}%`;
}

/** A rate with its 95 % interval: 98.6 % (97.7 to 99.2). */
export function interval({ mean, low, high }) {
  const ends = [low, high].map((v) => (v * 100).toFixed(1));
  return `${percent(mean)} (${ends.join(" to ")})`;
}

/** The 95 % Wilson interval of `rate` among `n`, as in app/policies/evaluation/statistics.py. */
export function wilson(rate, n) {
  const z = 1.959963984540054;
  const spread = z * Math.sqrt((rate * (1 - rate)) / n + (z / (2 * n)) ** 2);
  const [centre, scale] = [rate + z ** 2 / (2 * n), 1 + z ** 2 / n];
  const [low, high] = [(centre - spread) / scale, (centre + spread) / scale];
  return { mean: rate, low: rate === 0 ? 0 : Math.max(0, low), high: rate === 1 ? 1 : Math.min(1, high) };
}

/** A size in bytes: 21.8 KiB, 1.25 MiB. */
export function size(bytes) {
  return bytes < 1024 ** 2 ? `${number(bytes / 1024)}${NB}KiB` : `${number(bytes / 1024 ** 2)}${NB}MiB`;
}

/** A time span in seconds: 8 s, 2 min 10 s, 1 h 05 min. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s}${NB}s`;
  if (s < 3600) return `${Math.floor(s / 60)}${NB}min ${pad(s % 60)}${NB}s`;
  return `${Math.floor(s / 3600)}${NB}h ${pad(Math.floor((s % 3600) / 60))}${NB}min`;
}

/** A time of the cell or of a recording in seconds, with a decimal. */
export function seconds(t) {
  return Number.isFinite(t) ? `${t.toFixed(1)}${NB}s` : "–";
}

/** How long ago an ISO time of the server was. */
export function ago(iso, now = serverTime()) {
  if (!iso) return "";
  const past = (now - Date.parse(iso)) / 1000;
  if (past >= 2 * DAY_S) return `${Math.floor(past / DAY_S)}${NB}days${NB}ago`;
  return past < 5 ? "just now" : `${duration(past).replace(/ \d\d\ss$/, "")}${NB}ago`;
}

/** A plain number with at most `digits` significant digits; whole ones in groups from 10 000 on. */
export function number(v, digits = 3) {
  return Number.isFinite(v) ? grouped(Number(v.toPrecision(digits))) : String(v ?? "–");
}

/** A number with its unit. */
export function quantity(v, unit, digits = 3) {
  return `${number(v, digits)}${NB}${unit}`;
}

/** Labels of the ticks of an axis, with the digits that tell them apart. */
export function ticks(values) {
  const step = Math.abs(values[1] - values[0]);
  const decimals = step > 0 ? Math.min(20, Math.max(0, 1 - Math.floor(Math.log10(step)))) : 3;
  return values.map((v) => grouped(Number(v.toFixed(decimals))));
}

/** A value with all its digits, those of whole numbers from 10 000 on in groups of three. */
export function grouped(v) {
  if (typeof v !== "number") return typeof v === "string" ? v : JSON.stringify(v);
  const text = Number.isInteger(v) && Math.abs(v) >= 1e4 && Math.abs(v) < 1e21
    ? String(v).replace(/\B(?=(\d{3})+$)/g, "\u202f") : String(v);
  return v < 0 ? MINUS + text.slice(1) : text;
}

/** A text of the service with true minus signs and units kept with their numbers. */
export function typeset(text) {
  return String(text).replace(/(?<![\w.'"`\u2212-])-(?=[\d.])/g, MINUS)
    .replace(/(?<=\d) (?=(?:%|m|mm|cm|s|ms|min|h|Hz|steps)(?![\w/]))/g, NB);
}

/** A message of the service as a sentence; a name of a field at its start stays as it is. */
export function sentence(text) {
  const whole = typeset(/^[a-z]+(?![\w.[-]| = )/.test(text) ? capital(text) : text);
  return /[.!?…]$/.test(whole) ? whole : `${whole}.`;
}

/** A text with a capital at its start. */
export function capital(text) {
  return text ? String(text)[0].toUpperCase() + String(text).slice(1) : "";
}

/** The first characters of a checksum or job id. */
export function short(id) {
  return id ? String(id).slice(0, 8) : "–";
}

function trim(text) {
  return text.replace(/\.?0+$/, "");
}

function pad(n) {
  return String(n).padStart(2, "0");
}
