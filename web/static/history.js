// The last seconds of the critic's values, for the running plot.

export const SPAN_S = 20;

/** A silence longer than this is drawn as a gap [s]. */
const GAP_S = 2;

/**
 * Values of all candidates over the last `SPAN_S` seconds, by the clock on the wall: a paused
 * cell still answers to a person who is dragged.
 */
export class History {
  constructor() {
    this.samples = [];
    this.worldTime = 0;
  }

  /** Add what a snapshot says, which came at `t` [s]. */
  add(world, t = performance.now() / 1000) {
    const last = this.samples.at(-1);
    const broken = last && (t - last.t > GAP_S || world.t_s < this.worldTime);
    if (broken) this.samples.push({ t: last.t + 1e-3, values: new Map(), chosen: null });
    const values = new Map(world.candidates.map((c) => [c.id, c.value]));
    this.samples.push({ t, values, chosen: world.chosen });
    this.worldTime = world.t_s;
    while (this.samples[0].t < t - SPAN_S) this.samples.shift();
  }

  /** Seconds since sample `i`, negative. */
  age(i) {
    return this.samples[i].t - this.samples.at(-1).t;
  }

  /** Ids seen in the window, in the order of `order`. */
  ids(order) {
    const seen = new Set(this.samples.flatMap((s) => [...s.values.keys()]));
    return [...order.filter((id) => seen.has(id)), ...[...seen].filter((id) => !order.includes(id))];
  }

  /** Columns for uPlot: seconds before now (negative), then one column per id. */
  columns(ids) {
    const now = this.samples.at(-1)?.t ?? 0;
    const x = this.samples.map((s) => s.t - now);
    return [x, ...ids.map((id) => this.samples.map((s) => s.values.get(id) ?? null))];
  }

  /** The chosen id at each sample. */
  chosen() {
    return this.samples.map((s) => s.chosen);
  }
}
