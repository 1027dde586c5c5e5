// The live cell follows a training: its newest checkpoint acts as soon as it is stored.
import { html, useEffect, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { Fault, useAction } from "../action.js";
import { get, put, remove } from "../api.js";
import * as format from "../format.js";
import { WORLD } from "../live/world-stream.js";
import { isActive } from "./jobactions.js";

/** The server looks at a followed job once a second, and so does the page once it has ended or a request failed. */
const LOOK_MS = 1000;

export function Follow({ job }) {
  const [follow, setFollow] = useState(null);
  const changes = useRef(0);
  const action = useAction((answer) => {
    changes.current += 1;
    setFollow(answer);
  });
  useEffect(() => {
    let over = false;
    let timer = null;
    const look = () => {
      const before = changes.current; // an answer older than the last click is left out
      get("v1/worlds").then(({ items }) => {
        if (over || before !== changes.current) return;
        const now = items.find(({ id }) => id === WORLD)?.follow ?? null;
        setFollow(now);
        const isBehind = now?.job === job.id && now.active && !isActive(job);
        if (isBehind) timer = setTimeout(look, LOOK_MS);
      }, () => {
        if (!over) timer = setTimeout(look, LOOK_MS);
      });
    };
    look();
    return () => {
      over = true;
      clearTimeout(timer);
    };
  }, [isActive(job) ? job : job.state]);
  const mine = follow?.job === job.id;
  const path = `v1/worlds/${WORLD}/follow`;
  if (!isActive(job) && !mine) return null;
  return html`
    ${mine && follow.active
      ? html`<button type="button" class="tool" data-action="unfollow" disabled=${action.busy}
          onClick=${() => action.run(() => remove(path))}>Stop following</button>`
      : isActive(job) && html`<button type="button" class="tool" data-action="follow"
          disabled=${action.busy} title="The newest checkpoint of this job acts in the live cell"
          onClick=${() => action.run(() => put(path, { job: job.id }))}>Follow in cell</button>`}
    ${mine && html`<span class="faint" role="status" data-role="follow">${text(follow)}</span>`}
    <${Fault} error=${action.error} />`;
}

function text({ active, step, reason }) {
  if (!active) return format.sentence(`Followed no longer: ${reason}`);
  return step === null ? "The cell waits for its first checkpoint."
    : `The cell acts with the checkpoint at ${format.count(step, "step")}.`;
}
