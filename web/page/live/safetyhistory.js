// The last seconds of override and separation, for the running plots of the safety layer.
import { finite } from "../format.js";

export const SAFETY_SPAN_S = 20;

/** A jump longer than this is drawn as a gap [s]. */
const GAP_S = 2;
const KEYS = ["override", "advised", "separation", "required", "person_distance", "robot_distance", "margin"];

export class SafetyHistory {
  constructor() {
    this.samples = [];
    this.tick = -1;
    this.version = 0; // counts the changes of the samples
  }

  /** Add what a snapshot says, once; a paused cell says more of the same tick while people are dragged. */
  add({ tick, t_s: t, safety }) {
    const last = this.samples.at(-1);
    const sample = { t, ...Object.fromEntries(KEYS.map((key) => [key, safety[key]])) };
    if (tick === this.tick) {
      if (KEYS.every((key) => sample[key] === last[key])) return;
      this.samples.pop();
    } else if (tick < this.tick || (last && t < last.t)) this.samples = [];
    else if (last && t - last.t > GAP_S) this.samples.push({ t: last.t + 1e-3 });
    this.tick = tick;
    this.version += 1;
    this.samples.push(sample);
    while (this.samples[0].t < t - SAFETY_SPAN_S) this.samples.shift();
  }

  get now() {
    return this.samples.at(-1)?.t ?? 0;
  }

  /** Columns for uPlot: seconds before now (negative), then one per function of a sample. */
  columns(functions) {
    const { now } = this;
    return [
      this.samples.map((one) => one.t - now),
      ...functions.map((f) => this.samples.map((one) => finite(f(one)))),
    ];
  }
}
