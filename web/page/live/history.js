// The last seconds of the critic's values, for the running plot.

export const SPAN_S = 20;

/** A jump longer than this is drawn as a gap [s]. */
const GAP_S = 2;

/** Values that were decided longer ago are not those of the present state [s]. */
const FRESH_S = 0.06;

/**
 * Values of all candidates over the last `SPAN_S` seconds. Time is the cell's own, so that a
 * slow browser draws no bursts; while the cell is paused it is the clock on the wall, since a
 * paused cell still answers to a person who is dragged; nothing is added while nothing changes.
 */
export class History {
  constructor() {
    this.clear(null);
  }

  /** Forget all values, those of another cell. */
  clear(cell) {
    this.samples = [];
    this.last = null;
    this.cell = cell;
  }

  /** Add what a snapshot says, which came at `wall` [s]. */
  add(world, wall = performance.now() / 1000) {
    if (world.cell !== this.cell) this.clear(world.cell);
    const { last } = this;
    if (last && world.paused && this.isLast(world)) return;
    const cellTime = world.t_s - (last?.world ?? 0);
    const elapsed = !last ? 0 : cellTime > 0 ? cellTime : world.paused ? wall - last.wall : 0.05;
    if (last && (elapsed > GAP_S || cellTime < 0)) {
      this.samples.push({ t: this.samples.at(-1).t + 1e-3, values: new Map(), chosen: null });
    }
    const t = (last?.t ?? 0) + Math.min(elapsed, SPAN_S);
    // Between two motions the last decision stays as it was: nothing is known of now.
    const fresh = world.decided_s !== null && world.t_s - world.decided_s < FRESH_S;
    const values = new Map(fresh ? world.candidates.map((c) => [c.id, c.value]) : []);
    this.samples.push({ t, values, chosen: fresh ? world.chosen : null });
    this.last = { t, wall, world: world.t_s };
    while (this.samples[0].t < t - SPAN_S) this.samples.shift();
  }

  /** Whether a snapshot says what the last sample says. */
  isLast({ candidates, chosen, t_s: t }) {
    const { values, chosen: before } = this.samples.at(-1);
    return t === this.last.world && chosen === before && candidates.length === values.size
      && candidates.every(({ id, value }) => values.get(id) === value);
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

  /** Target switches; `open` where the previous target was still a candidate. */
  switches() {
    let last = null;
    return this.samples.flatMap(({ chosen, values }, i) => {
      const before = last;
      last = chosen ?? last;
      return before && chosen && before !== chosen ? [{ i, open: values.has(before) }] : [];
    });
  }

  /** The chosen id at each sample. */
  chosen() {
    return this.samples.map((s) => s.chosen);
  }
}
