// Colour means one thing on the whole page and in the scene: how much a goal falls short of
// the best one. Names, not colours, tell the goals apart.

/** Shortfall in value -> colour; the same ramp as RAMP in web/stations_view.py. */
const RAMP = [
  [0.0, [38, 166, 104]],
  [0.35, [150, 190, 62]],
  [0.8, [240, 176, 52]],
  [1.6, [222, 78, 62]],
];
const UNKNOWN = "rgb(122 142 166)";
const IDLE = "rgb(196 202 210)";

/** Colours of the people's vests, by id; the same as VESTS in web/mannequin.py. */
export const VESTS = ["rgb(255 116 32)", "rgb(196 214 48)", "rgb(72 164 232)", "rgb(232 104 168)"];

/** Colour of a goal worth `value` where the best is worth `best`. */
export function colourByValue(value, best) {
  if (!Number.isFinite(value) || !Number.isFinite(best)) return UNKNOWN;
  const gap = Math.min(Math.max(best - value, 0), RAMP.at(-1)[0]);
  const i = Math.max(1, RAMP.findIndex(([x]) => gap <= x));
  const [[x0, from], [x1, to]] = [RAMP[i - 1], RAMP[i]];
  const share = (gap - x0) / (x1 - x0);
  return `rgb(${from.map((c, k) => Math.round(c + share * (to[k] - c))).join(" ")})`;
}

/** Colours of the goals of a snapshot by id; grey for what is no candidate. */
export function goalColours(candidates) {
  const best = bestOf(candidates.map((c) => c.value));
  const colours = new Map(candidates.map((c) => [c.id, colourByValue(c.value, best)]));
  return (id) => colours.get(id) ?? IDLE;
}

export function bestOf(values) {
  return Math.max(...values.filter((v) => Number.isFinite(v)));
}

/** The page's own colours as the style sheet has them now (light or dark). */
export function themeColours() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(name).trim();
  return {
    ink: read("--ink"),
    soft: read("--ink-2"),
    faint: read("--ink-3"),
    grid: read("--grid"),
    panel: read("--panel"),
    good: read("--good"),
    bad: read("--bad"),
    warn: read("--warn"),
    accent: read("--accent"),
  };
}
