// Panel of a sorting cell: status, goal, blocks, ranking of moves.
import { html, useEffect, useState } from "../vendor/htm-preact-standalone.module.js";
import { Blocks } from "./blocks.js";
import { GoalEditor } from "./goaleditor.js";
import { Moves, SortingSmallPrint } from "./ranking.js";
import { Safety } from "../live/safety.js";
import { StatusPanel } from "../live/status.js";

const PHASES = {
  approach: ["Moving to target", "accent"],
  grasp: ["Grasping", "accent"],
  carry: ["Carrying", "accent"],
  place: ["Placing", "accent"],
};

export function SortingDecision({ world, cell, send, checkpoints, jobs }) {
  const { sorting } = world;
  const [picked, setPicked] = useState(null);
  const there = picked === null || cell.stations.some((one) => one.id === picked)
    || sorting.blocks.some((one) => one.id === picked);
  useEffect(() => {
    if (!there) setPicked(null);
  }, [there]);
  const pick = (id) => setPicked(id === picked ? null : id);
  const shared = { sorting, cell, send, picked, onPick: pick };
  return html`<${StatusPanel} world=${world} chip=${chip(world)} />
    <${GoalEditor} ...${shared} />
    <${Blocks} ...${shared} />
    <${Moves} sorting=${sorting} cell=${cell} />
    <${Safety} world=${world} />
    <${SortingSmallPrint} world=${world} cell=${cell} checkpoints=${checkpoints} jobs=${jobs}
      send=${send} />`;
}

/** What the story's chip says where the world's status is too coarse for sorting. */
function chip({ status, sorting }) {
  if (status === "moving" || status === "picking") return PHASES[sorting.phase] ?? null;
  return sorting.goal.length === 0 && status === "no candidates" ? ["No goal", "quiet"] : null;
}
