// Numbers and names as people read them. SI units come in; cm, percent and minutes go out.

import { serverTime } from "./api.js";

const MINUS = "\u2212";
const DAY_S = 24 * 3600;

/** A critic's value with two decimals and a true minus sign. */
export function value(v) {
  if (v === null || v === undefined || !Number.isFinite(v)) return "–";
  const text = Math.abs(v).toFixed(2);
  return v < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/** A distance in metres, in cm below one metre. */
export function distance(metres) {
  if (metres === null || metres === undefined || !Number.isFinite(metres)) return "–";
  return metres < 0.995 ? `${Math.round(metres * 100)} cm` : `${metres.toFixed(1)} m`;
}

/** How far somebody is from the robot, in metres; contact where nothing is between them. */
export function gap(metres) {
  if (metres === null || metres === undefined || !Number.isFinite(metres)) return "–";
  return metres <= 0 ? "contact" : `${metres.toFixed(2)} m`;
}

/** A count of steps: 950, 12.4 k, 1.25 M. */
export function steps(n) {
  if (n === null || n === undefined) return "–";
  if (n >= 999_950) return `${trim((n / 1e6).toFixed(2))} M`;
  if (n >= 1e4) return `${trim((n / 1e3).toFixed(1))} k`;
  return String(Math.round(n));
}

/** A rate in [0, 1] as percent. */
export function percent(rate, digits = 1) {
  if (rate === null || rate === undefined || !Number.isFinite(rate)) return "–";
  return `${(rate * 100).toFixed(digits)} %`;
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

/** A time span in seconds: 8 s, 2 min 10 s, 1 h 05 min. */
export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${pad(s % 60)} s`;
  return `${Math.floor(s / 3600)} h ${pad(Math.floor((s % 3600) / 60))} min`;
}

/** How long ago an ISO time of the server was. */
export function ago(iso, now = serverTime()) {
  if (!iso) return "";
  const seconds = (now - Date.parse(iso)) / 1000;
  if (seconds >= 2 * DAY_S) return `${Math.floor(seconds / DAY_S)} days ago`;
  return seconds < 5 ? "just now" : `${duration(seconds).replace(/ \d\d s$/, "")} ago`;
}

/** A plain number with at most `digits` significant digits. */
export function number(v, digits = 3) {
  if (typeof v !== "number" || !Number.isFinite(v)) return String(v ?? "–");
  const text = String(Number(v.toPrecision(digits)));
  return text.replace("-", MINUS);
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
