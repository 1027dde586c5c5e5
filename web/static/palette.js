// One colour per station, the same in the scene, the bars and the plot.

const FALLBACK = [
  "#2f6fde", "#e0662b", "#2a9d63", "#8a5cd6", "#c79a12", "#d04a8c", "#7b8794", "#1797a6",
];

/** Colours of the candidates by id: the cell's own where it names them. */
export function stationColours(stations) {
  const colours = new Map();
  stations.forEach((station, i) => {
    colours.set(station.id, css(station.colour ?? station.color) ?? FALLBACK[i % FALLBACK.length]);
  });
  return (id) => colours.get(id) ?? FALLBACK[hash(id) % FALLBACK.length];
}

function css(colour) {
  if (Array.isArray(colour)) return `rgb(${colour.map((c) => Math.round(c)).join(" ")})`;
  return colour || null;
}

function hash(text) {
  let h = 7;
  for (const c of String(text)) h = (h * 31 + c.charCodeAt(0)) >>> 0;
  return h;
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
