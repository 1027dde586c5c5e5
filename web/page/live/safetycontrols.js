// Controls of the safety layer: whether it acts, and its assumptions.
import { html } from "../vendor/htm-preact-standalone.module.js";
import { marked, Segmented } from "../choice.js";

const OFF = ["off", "Disabled", "The robot moves without a safety layer"];
const AMONG_CYLINDERS = [
  ["assumed", "Assumed speed", "The safety layer assumes a walking speed in every direction"],
  ["measured", "Measured velocity", "The safety layer uses the measured velocities of people; the rollout takes it into account"],
  OFF,
];
const AMONG_WORKERS = [
  ["assumed", "SSM", "The robot stops before a person can touch it in motion"],
  ["pfl", "SSM and PFL", "The robot may touch a person while it is slower than the admissible contact speed"],
  OFF,
];
const DISTANCES = [0, 0.1, 0.3];

export function SafetyControls({ world, send }) {
  const { safety } = world;
  const items = world.reach ? AMONG_CYLINDERS : AMONG_WORKERS;
  const change = (fields) => send({ tag: "set-safety", ...fields });
  const settings = (one) => (world.reach ? { use_measured_velocity: one === "measured" } : { pfl: one === "pfl" });
  return html`<span class="dock-pair"><span class="dock-label dock-label-free" id="layer-label">Safety layer</span>
    <${Segmented} labelledby="layer-label" mark=${marked("safety")} value=${layerOf(world)} items=${items}
      onPick=${(one) => change({ on: one !== "off", ...(one !== "off" && settings(one)) })} /></span>
    <span class="dock-pair"><span class="dock-label dock-label-free" id="distance-label">Protective distance</span>
    <${Segmented} labelledby="distance-label" mark=${marked("distance")} value=${safety.protective_distance}
      items=${DISTANCES.map((one) => [one, `${one} m`, "Least distance to people while the robot moves"])}
      onPick=${(one) => change({ protective_distance: one })} /></span>`;
}

/** Which of the choices holds for the safety layer. */
function layerOf({ reach, safety }) {
  if (!safety.on) return "off";
  if (reach) return safety.use_measured_velocity ? "measured" : "assumed";
  return safety.pfl ? "pfl" : "assumed";
}
