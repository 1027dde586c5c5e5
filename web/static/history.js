// The last seconds of the critic's values, for the running plot.

export const SPAN_S = 20;

/** Values of all candidates over the last `SPAN_S` seconds of world time. */
export class History {
  constructor() {
    this.samples = [];
  }

  /** Add what a snapshot says; world time that jumps back starts afresh. */
  add(world) {
    const last = this.samples.at(-1);
    if (last && world.t_s < last.t) this.samples = [];
    else if (last && world.t_s === last.t) this.samples.pop();
    const values = new Map(world.candidates.map((c) => [c.id, c.value]));
    this.samples.push({ t: world.t_s, values, chosen: world.chosen });
    const from = world.t_s - SPAN_S;
    while (this.samples.length && this.samples[0].t < from) this.samples.shift();
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
