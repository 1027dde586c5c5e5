// uPlot as Preact components: the running plot of values and the learning curves.
import { html, useEffect, useMemo, useRef, useState } from "./vendor/htm-preact-standalone.module.js";
import * as format from "./format.js";
import { SPAN_S } from "./live/history.js";
import { drawValues, valueRange } from "./live/value-plot.js";
import { themeColours } from "./palette.js";

const [LEAST_NAME, MOST_NAME] = [58, 120];
const FONT = "11px Inter, system-ui, sans-serif";
const LABEL_GAP = 10; // between the labels of an axis and its line, and beside them [px]

/** Whether a media query holds at present. */
export function useMedia(condition) {
  const query = useMemo(() => matchMedia(condition), [condition]);
  const [matches, setMatches] = useState(query.matches);
  useEffect(() => {
    const update = () => setMatches(query.matches);
    query.addEventListener("change", update);
    return () => query.removeEventListener("change", update);
  }, [query]);
  return matches;
}

/** The page's colours; changes with the system's light and dark. */
export function useTheme() {
  const isDark = useMedia("(prefers-color-scheme: dark)");
  return useMemo(themeColours, [isDark]);
}

/** One uPlot in a box that gives its width; `options` must be stable between data changes. */
export function Plot({ options, data, height, label }) {
  const box = useRef(null);
  const plot = useRef(null);
  useEffect(() => {
    const width = Math.max(120, box.current.clientWidth);
    const drawn = new window.uPlot({ ...options, width, height }, data, box.current);
    plot.current = drawn;
    const observer = new ResizeObserver(() => {
      const wide = box.current?.clientWidth;
      if (wide > 0 && wide !== drawn.width) drawn.setSize({ width: wide, height });
    });
    observer.observe(box.current);
    return () => {
      observer.disconnect();
      plot.current = null;
      drawn.destroy();
    };
  }, [options, height]);
  useEffect(() => plot.current?.setData(data), [data, options]);
  return html`<div class="plot" ref=${box} role="img" aria-label=${label}></div>`;
}

export function axis(theme, more) {
  return {
    stroke: theme.faint,
    font: FONT,
    grid: { stroke: theme.grid, width: 1 },
    ticks: { show: false },
    ...more,
  };
}

/** A vertical axis of numbers, at least `size` pixels wide and as wide as its labels need. */
function numberAxis(theme, { size, ...more }) {
  return axis(theme, {
    size: (plot, labels, k, cycle) => (cycle > 1 ? plot.axes[k]._size
      : Math.max(size, Math.ceil(widest(labels ?? [], FONT)) + LABEL_GAP)),
    values: (_, values) => format.ticks(values),
    ...more,
  });
}

/** Width of the widest of some texts [px]. */
function widest(texts, font) {
  const context = document.createElement("canvas").getContext("2d");
  context.font = font;
  return Math.max(0, ...texts.map((text) => context.measureText(text).width));
}

/** Labels of an axis of rates. */
function percents(_, values) {
  return format.ticks(values.map((v) => 100 * v)).map((text) => `${text} %`);
}

export function secondsAgo(v) {
  return v === 0 ? "now" : format.quantity(v, "s");
}

/** Values of all candidates over the last seconds; the chosen one is drawn thick. */
export function ValuePlot({ history, ids, labelOf, colourOf, chosen, onHover }) {
  const theme = useTheme();
  const live = useRef({});
  live.current = { history, labelOf, colourOf, onHover };
  const key = ids.join("|");
  const stamp = history.samples.at(-1)?.t;
  const options = useMemo(() => valueOptions(theme, ids, live), [key, theme]);
  const data = useMemo(() => history.columns(ids), [stamp, key]);
  const label = `Critic's value of ${ids.length} candidates over the last ${SPAN_S} seconds; ` +
    `chosen now: ${chosen ? labelOf(chosen) : "none"}`;
  return html`<${Plot} options=${options} data=${data} height=${176} label=${label} />`;
}

function valueOptions(theme, ids, live) {
  return {
    legend: { show: false },
    padding: [8, roomForNames(ids.map(live.current.labelOf)), 0, 0],
    cursor: { y: false, drag: { setScale: false, x: false, y: false }, points: { show: false } },
    scales: {
      x: { time: false, range: [-SPAN_S, 0] },
      y: { range: (_, low, high) => padded(...valueRange(low, high), 0.6) },
    },
    axes: [
      axis(theme, { size: 24, space: 70, values: (_, ticks) => ticks.map(secondsAgo) }),
      numberAxis(theme, { size: 40, space: 32 }),
    ],
    series: [{}, ...ids.map((id) => ({ label: id, paths: () => null, points: { show: false } }))],
    hooks: {
      draw: [(plot) => drawValues(plot, live.current, theme)],
      setCursor: [(plot) => live.current.onHover?.(plot.cursor.idx)],
    },
  };
}

/** Width of the names beside the value plot [px]; longer ones are cut. */
function roomForNames(names) {
  const width = widest(names, FONT.replace("11px", "650 11px")) + 10;
  return Math.ceil(Math.min(MOST_NAME, Math.max(LEAST_NAME, width)));
}

function padded(low, high, least) {
  if (low === null || high === null || !Number.isFinite(low)) return [-1, 1];
  const room = Math.max((high - low) * 0.12, (least - (high - low)) / 2, 0.02);
  return [low - room, high + room];
}

/** Learning curves against environment steps; `lines` are {key, label, colour}. */
export function CurvePlot({ rows, lines, height, label, unit, range, sync, onHover }) {
  const theme = useTheme();
  const hover = useRef(onHover);
  hover.current = onHover;
  const key = lines.map((l) => l.key).join("|");
  const options = useMemo(() => stepOptions(theme, hover, {
    y: { range: range ?? ((_, low, high) => padded(low, high, 0.2)) }, size: 46, unit, sync,
    series: [{}, ...lines.map((l) => (
      { label: l.label, stroke: theme[l.colour] ?? l.colour, width: 1.75, points: FEW }))],
  }), [key, theme, unit, sync]);
  const data = useMemo(
    () => [rows.map((r) => r.step), ...lines.map((l) => rows.map((r) => format.finite(r[l.key])))],
    [rows, key]);
  return html`<${Plot} options=${options} data=${data} height=${height} label=${label} />`;
}

/** Dots of a curve that has too few points for a line. */
export const FEW = { show: (plot) => plot.data[0].length < 3, size: 5 };

/** Options of curves against environment steps; `size` is the least width of the vertical axis. */
export function stepOptions(theme, hover, { y, size, unit, sync, ...more }) {
  return {
    legend: { show: false },
    padding: [8, 16, 0, 0],
    cursor: {
      y: false,
      sync: sync ? { key: sync } : undefined,
      drag: { setScale: false, x: false, y: false },
      points: { size: 5 },
    },
    scales: {
      x: { time: false, range: (_, low, high) => [Math.min(0, low ?? 0), Math.max(high ?? 1, 1)] },
      y,
    },
    axes: [
      axis(theme, { size: 24, space: 64, values: (_, t) => t.map((v) => (v ? format.steps(v) : "0")) }),
      numberAxis(theme, { size, space: 30, ...(unit === "%" && { values: percents }) }),
    ],
    hooks: { setCursor: [(plot) => hover.current?.(plot.cursor.idx)] },
    ...more,
  };
}
