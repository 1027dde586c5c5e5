// The goal, tower by tower: what stands there now beside what shall stand there. Blocks are
// clicked in from below and out of the tower; the largest always lies at the bottom.
import { html, useState } from "../vendor/htm-preact-standalone.module.js";
import { Block, kindOf, nameOf } from "./block-icon.js";
import * as format from "../format.js";
import { BLOCKS } from "../palette.js";
import { useListFocus } from "../listfocus.js";

export function GoalEditor({ sorting, cell, send, picked, onPick }) {
  const [goal, setGoal] = useGoal(sorting, send);
  const section = useListFocus();
  const towers = cell.stations.filter((one) => one.kind === "cluster");
  const wanted = Object.values(goal).flat().length;
  const put = (tower, sizes) => setGoal({ ...goal, [tower]: sorted(sizes, sorting.sizes) });
  return html`<section class="card" aria-labelledby="goal-title" ref=${section}>
    <header class="card-head">
      <h2 id="goal-title" tabindex="-1">Goal</h2>
      ${wanted > 0 && html`<button type="button" class="text-button" data-action="clear-goal"
        onClick=${() => setGoal({})}>Clear</button>`}
    </header>
    <p class="goal-text" role="status" data-role="goal-text">${progress(sorting, wanted)}</p>
    <div class="towers">
      ${towers.map((tower) => html`<${Tower} key=${tower.id} tower=${tower} sorting=${sorting}
        sizes=${goal[tower.id] ?? []} onPut=${(sizes) => put(tower.id, sizes)}
        picked=${picked} onPick=${onPick} />`)}
    </div>
  </section>`;
}

function progress(sorting, wanted) {
  if (wanted === 0) return "No goal yet. Click a block below a tower to ask for it.";
  if (sorting.solved) return `Reached: ${format.count(wanted, "block")} ${wanted === 1 ? "stands" : "stand"} as asked.`;
  const done = sorting.goal.filter((one) => one.done).length;
  const { moves_to_go: moves, attempts_to_go: attempts } = sorting;
  const rest = Number.isFinite(moves) && moves > 0
    ? ` ${format.count(moves, "move")} to go, about ${format.number(attempts, 2)} ${attempts < 1.05 ? "grasp" : "grasps"}.` : "";
  return `${done} of ${format.count(wanted, "block")} in place.${rest}`;
}

/** One tower: now and goal side by side on its plate, and the kinds it can still be given. */
function Tower({ tower, sorting, sizes, onPut, picked, onPick }) {
  const { colour } = tower;
  const group = useListFocus(".offer:enabled");
  const now = sorting.blocks.filter((one) => one.place === tower.id && !one.held)
    .sort((a, b) => a.level - b.level);
  const done = new Set(sorting.goal.filter((one) => one.tower === tower.id && one.done)
    .map((one) => one.level));
  const out = (level) => onPut(sizes.filter((_, k) => k !== level));
  return html`<div class="tower" role="group" aria-label=${`${format.capital(colour)} tower`}
    ref=${group}>
    <div class="stacks">
      <div class="stack" role="group" aria-label="On it now">
        ${now.map((one) => html`<button type="button" key=${one.id} class="block-button"
          data-block=${one.id} aria-pressed=${String(picked === one.id)}
          aria-label=${`${format.capital(nameOf(one))}, level ${one.level + 1}`}
          onClick=${() => onPick(one.id)}><${Block} ...${one} sizes=${sorting.sizes} /></button>`)}
      </div>
      <div class="stack" role="group" aria-label="Goal">
        ${sizes.map((size, level) => html`<button type="button" key=${level} class="block-button"
          data-goal-block=${`${tower.id}-${level}`} title="Take it out of the goal"
          aria-label=${`Take the ${nameOf({ colour, size })} out of the goal`}
          onClick=${() => out(level)}>
          <${Block} colour=${colour} size=${size} sizes=${sorting.sizes}
            wanted=${!done.has(level)} /></button>`)}
        ${sizes.length === 0 && html`<span class="stack-empty">empty</span>`}
      </div>
    </div>
    <div class="plate" style=${{ "--plate": BLOCKS[colour] }}><span>now</span><span>goal</span></div>
    <div class="offers" role="group" aria-label=${`Add to the goal of the ${colour} tower`}>
      ${[...sorting.sizes].reverse().map((size) => html`<${Offer} key=${size} colour=${colour}
        size=${size} sizes=${sorting.sizes} sorting=${sorting} asked=${sizes}
        onAdd=${() => onPut([...sizes, size])} />`)}
    </div>
  </div>`;
}

/** A kind of block that can be asked for, with how many are left; says why when it cannot. */
function Offer({ colour, size, sizes, sorting, asked, onAdd }) {
  const kind = kindOf({ colour, size });
  const name = nameOf({ colour, size });
  const there = sorting.blocks.filter((one) => kindOf(one) === kind).length;
  const left = there - asked.filter((one) => one === size).length;
  const why = there === 0 ? `There is no ${name}: add one below`
    : `All ${format.count(there, name)} are in the goal: add another below`;
  const reason = there === 1 && left <= 0 ? `The ${name} is in the goal: add another below` : why;
  return html`<button type="button" class="offer" data-goal-add=${kind} disabled=${left <= 0}
    title=${left > 0 ? `Ask for a ${name}` : reason}
    aria-label=${left > 0 ? `Ask for a ${name}, ${left} left` : `${reason}`} onClick=${onAdd}>
    <${Block} colour=${colour} size=${size} sizes=${sizes} />
    <b>${left < 0 ? `lacks ${-left}` : `×${left}`}</b></button>`;
}

/**
 * The goal as sizes from the bottom by tower, and how to change it. What was clicked holds at
 * once; the world's own goal holds again once it shows the newest click, or has not in time.
 */
function useGoal(sorting, send) {
  const [draft, setDraft] = useState(null);
  const known = {};
  for (const one of sorting.goal) (known[one.tower] ??= [])[one.level] = one.size;
  const change = async (towers) => {
    const asked = Object.fromEntries(Object.entries(towers).filter(([, sizes]) => sizes.length));
    setDraft(asked);
    await send({ tag: "set-goal", towers: asked });
    setDraft((now) => (now === asked ? null : now));
  };
  return [draft ?? known, change];
}

function sorted(chosen, sizes) {
  return [...chosen].sort((a, b) => sizes.indexOf(b) - sizes.indexOf(a));
}
