// A goal has one colour on the whole page and in the scene, whatever it is worth: lengths of
// bars, heights of lines and ranks in numbers tell that.

/** Colours of the goals, in the cell's order; the same as GOALS in web/viewer/scene/stations_view.py. */
export const GOALS = [
  "rgb(49 119 220)", "rgb(206 100 0)", "rgb(0 146 159)", "rgb(167 76 193)", "rgb(140 131 0)",
  "rgb(211 45 72)", "rgb(146 94 50)", "rgb(42 144 75)", "rgb(202 87 148)", "rgb(98 108 196)",
];
const IDLE = "rgb(196 202 210)";

/** Colours of the people's vests, by id; the same as VESTS in app/sim/cells/colours.py. */
export const VESTS = ["rgb(255 116 32)", "rgb(196 214 48)", "rgb(72 164 232)", "rgb(232 104 168)"];

/** Colours of sorted blocks, and of what is written on them; as BLOCKS in app/sim/cells/colours.py. */
export const BLOCKS = { red: "rgb(205 58 62)", green: "rgb(112 184 92)", blue: "rgb(52 104 196)" };
const DARK_INK = "rgb(15 21 26)";
export const BLOCK_INK = { red: "white", green: DARK_INK, blue: "white" };

/** Chance that a grasp fails -> colour of its clutter slot; as FAILURES in app/sim/cells/colours.py. */
const FAILURES = [
  [0.0, [240, 237, 229]],
  [0.2, [243, 217, 164]],
  [0.4, [226, 166, 92]],
  [0.7, [176, 108, 48]],
  [1.0, [112, 62, 24]],
];
const LIGHT_ON_FAILURE = 0.6;

/** Override -> colour; the same as OVERRIDES in web/viewer/scene/reach_scene.py. */
export const OVERRIDES = [
  [0.0, [214, 52, 46]],
  [0.5, [240, 176, 52]],
  [1.0, [38, 166, 104]],
];

/** The terms of the protective separation distance. */
export const TERMS = { person: "rgb(240 176 92)", robot: "rgb(104 150 210)", margin: "rgb(160 172 184)" };

/** Colour of a robot that goes at this share of its speed. */
export function overrideColour(override) {
  return along(OVERRIDES, override);
}

/** Colour of a slot where grasps fail with this chance, and of what is written on it. */
export function failureColours(chance) {
  const ink = chance < LIGHT_ON_FAILURE ? DARK_INK : "white";
  return { background: along(FAILURES, chance), ink };
}

/** The failure map's colours from 0 to `chance` as a gradient to the right. */
export function failureGradient(chance) {
  const stops = Array.from({ length: 9 }, (_, i) => along(FAILURES, (i / 8) * chance));
  return `linear-gradient(to right, ${stops.join(", ")})`;
}

/** Colour at `x` of a ramp of [x, [r, g, b]]; its ends beyond them. */
function along(ramp, x) {
  const at = Math.min(Math.max(x, ramp[0][0]), ramp.at(-1)[0]);
  const i = Math.max(1, ramp.findIndex(([stop]) => at <= stop));
  const [[x0, from], [x1, to]] = [ramp[i - 1], ramp[i]];
  const share = (at - x0) / (x1 - x0);
  return `rgb(${from.map((c, k) => Math.round(c + share * (to[k] - c))).join(" ")})`;
}

/** Colours of a cell's goals by id. */
export function goalColours(stations) {
  const goals = stations.filter(({ kind }) => kind === "cube" || kind === "dock");
  const colours = new Map(goals.map(({ id }, i) => [id, GOALS[i % GOALS.length]]));
  return (id) => colours.get(id) ?? IDLE;
}

/** The page's own colours as the style sheet has them now (light or dark). */
export function themeColours() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(name).trim();
  return {
    ink: read("--ink"),
    faint: read("--ink-3"),
    grid: read("--grid"),
    panel: read("--panel"),
    good: read("--good"),
    bad: read("--bad"),
    warn: read("--warn"),
    accent: read("--accent"),
  };
}
