// Hint over the scene on the first visit: what to try, and a button that sets it up.
import { html, useState } from "./vendor/htm-preact-standalone.module.js";
import { Close } from "./icons.js";
import { keep, kept } from "./kept.js";

const KEPT = "tandem-tried";
const BESIDE_M = 0.3;

/** What to try in a kind of cell: `ask` gives the commands that set it up. */
const TRIES = {
  choice: {
    text: "Put a hand on the robot's target: it switches to another one.",
    button: "Block the target",
    ask({ candidates, chosen, people }) {
      const at = (candidates.find(({ id }) => id === chosen) ?? candidates[0])?.position;
      if (!at || people.length === 0) return [];
      const person = people[0].id;
      return [{ tag: "set-mode", person, mode: "manual" },
        { tag: "move-person", person, [at[0] < 0 ? "right" : "left"]: at }];
    },
  },
  reach: {
    text: "Step between the robot and its goal: it slows down and stops before contact.",
    button: "Block the path",
    ask({ people, reach }) {
      if (people.length === 0) return [];
      const person = people[0].id;
      const [x, y] = reach.goal;
      return [{ tag: "set-mode", person, mode: "manual" },
        { tag: "move-person", person, pelvis: [x, y + BESIDE_M, 0] }];
    },
  },
  sorting: {
    text: "Add blocks to the goal and change it while the robot works: it replans.",
    button: "Sort five blocks",
    ask: (_, cell) => (cell?.sorting_tests ?? []).slice(0, 1)
      .map(({ id }) => ({ tag: "start-test", id })),
  },
};

export function FirstUse({ world, cell, send }) {
  const [tried, setTried] = useState(() => [kept("localStorage", KEPT) ?? []].flat());
  const kind = world.sorting ? "sorting" : world.reach ? "reach" : "choice";
  if (tried.includes(kind)) return null;
  const { text, button, ask } = TRIES[kind];
  const commands = ask(world, cell);
  const start = async () => {
    if (world.paused) await send({ tag: "resume" });
    for (const command of commands) await send(command);
  };
  const dismiss = () => {
    const now = [...tried, kind];
    setTried(now);
    keep("localStorage", KEPT, now);
  };
  return html`<p class="first-use" data-role="first-use"><span><b>Try it.</b> ${text}</span>
    ${commands.length > 0 && html`<button type="button" class="tool" data-action="try"
      onClick=${start}>${button}</button>`}
    <${Close} label="Do not show this again" data-action="dismiss-first-use"
      onClick=${dismiss} /></p>`;
}
