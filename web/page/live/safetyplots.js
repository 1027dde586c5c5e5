// The running plots of the safety layer: the override, and the separation over the terms of S_p.
import { html, useMemo } from "../vendor/htm-preact-standalone.module.js";
import { OVERRIDES, overrideColour, TERMS } from "../palette.js";
import { axis, Plot, secondsAgo, useTheme } from "../plots.js";
import { SAFETY_SPAN_S } from "./safetyhistory.js";

const FAR_M = 1.6;
const HEIGHT = { override: 92, separation: 150 };
const BASE = {
  legend: { show: false },
  padding: [8, 12, 0, 0],
  cursor: { show: false },
};
const X = { time: false, range: [-SAFETY_SPAN_S, 0] };

/** The override, coloured as it is high or low; what the layer would set is dashed. */
export function OverridePlot({ history, on }) {
  const theme = useTheme();
  const options = useMemo(() => ({
    ...BASE,
    scales: { x: X, y: { range: [0, 1.04] } },
    axes: [
      axis(theme, { size: 4, show: true, values: () => [] }),
      axis(theme, { size: 44, splits: () => [0, 0.5, 1], values: () => ["0 %", "50 %", "100 %"] }),
    ],
    series: [
      {},
      { label: "advised", stroke: theme.faint, width: on ? 0 : 1.25, dash: [4, 4], points: { show: false } },
      { label: "override", stroke: (u) => ramp(u, 1), fill: (u) => ramp(u, 0.22), width: 2,
        points: { show: false } },
    ],
  }), [theme, on]);
  const data = useMemo(() => history.columns([(s) => (on ? null : s.advised), (s) => s.override]),
    [history.version, on]);
  const now = data[2].at(-1);
  const label = `Override over the last ${SAFETY_SPAN_S} seconds; now ` +
    `${Number.isFinite(now) ? Math.round(100 * now) : "unknown"} percent`;
  return html`<${Plot} options=${options} data=${data} height=${HEIGHT.override} label=${label} />`;
}

/** A gradient over the plot's height in the colours of the override. */
function ramp(plot, opacity) {
  const { ctx, bbox } = plot;
  if (!Number.isFinite(bbox.height) || bbox.height <= 0) return overrideColour(1);
  const gradient = ctx.createLinearGradient(0, bbox.top + bbox.height, 0, bbox.top);
  for (const [at, [r, g, b]] of OVERRIDES) gradient.addColorStop(at, `rgb(${r} ${g} ${b} / ${opacity})`);
  return gradient;
}

/** The terms of S_p on top of each other, and the separation as a line. */
export function SeparationPlot({ history }) {
  const theme = useTheme();
  const options = useMemo(() => {
    const area = (key) => ({ label: key, fill: TERMS[key], width: 0, points: { show: false } });
    return {
      ...BASE,
      scales: { x: X, y: { range: [0, FAR_M] } },
      axes: [
        axis(theme, { size: 24, space: 70, values: (_, ticks) => ticks.map(secondsAgo) }),
        axis(theme, { size: 44, splits: () => [0, 0.5, 1, 1.5],
          values: (_, ticks) => ticks.map((v) => `${v} m`) }),
      ],
      series: [{}, area("person"), area("robot"), area("margin"),
        { label: "separation", stroke: theme.ink, width: 2, points: { show: false } }],
    };
  }, [theme]);
  const data = useMemo(() => history.columns([
    (s) => s.required,
    (s) => s.margin + s.robot_distance,
    (s) => (s.required === null ? null : s.margin),
    (s) => Math.max(0, s.separation),
  ].map((f) => (s) => (Number.isFinite(s.separation) ? f(s) : null))), [history.version]);
  const label = `Separation distance of the person who limits the override, or would first, over the last ${SAFETY_SPAN_S} seconds and the terms of S_p`;
  return html`<${Plot} options=${options} data=${data} height=${HEIGHT.separation} label=${label} />`;
}
