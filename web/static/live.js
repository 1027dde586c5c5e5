// The live cell as this page knows it: its last snapshot, its recent values, the link to it.
import { useCallback, useEffect, useRef, useState } from "./vendor/htm-preact-standalone.module.js";
import { follow, get, post, put } from "./api.js";
import { History } from "./history.js";

export const WORLD = "main";
const RETRY_MS = 1000;

/**
 * Follow the server and its world.
 *
 * @returns {{link: "connecting"|"warming"|"live"|"lost"|"signin", reason: string, world: object|null,
 *            cell: object|null, cells: object[], history: History, epoch: number,
 *            send: (command: object) => Promise<void>, show: (cell: string) => Promise<void>}}
 *   `epoch` counts how often the server was found ready: the viewer is loaded anew each time.
 */
export function useCell() {
  const [state, setState] = useState({ link: "connecting", reason: "", world: null, cell: null, cells: [] });
  const [epoch, setEpoch] = useState(0);
  const [error, setError] = useState(null);
  const history = useRef(new History());

  useEffect(() => {
    const stop = new AbortController();
    watch(stop.signal, history.current, setState, setEpoch);
    return () => stop.abort();
  }, []);

  const told = useCallback(async (request) => {
    try {
      await request;
      setError(null);
    } catch (problem) {
      setError(problem);
    }
  }, []);
  const send = useCallback(
    (command) => told(post(`v1/worlds/${WORLD}/commands`, command)), []);
  const show = useCallback((name) => told(put(`v1/worlds/${WORLD}/cell`, { cell: name })), []);
  const dismiss = () => setError(null);
  return { ...state, epoch, history: history.current, send, show, error, dismiss };
}

/** Wait until ready, then follow the world; for ever. */
async function watch(signal, history, setState, setEpoch) {
  const merge = (more) => !signal.aborted && setState((now) => ({ ...now, ...more }));
  while (!signal.aborted) {
    await ready(signal, merge);
    try {
      const [world, cells] = await Promise.all([get(`v1/worlds/${WORLD}`), get("v1/cells")]);
      const list = cells.items;
      const cell = list.find((c) => c.name === world.cell) ?? null;
      let anew = false;
      history.add(world);
      merge({ world, cell, cells: list, link: "live", reason: "" });
      setEpoch((n) => n + 1);
      await until(signal, (lost) =>
        follow(`v1/worlds/${WORLD}/events`, {
          onEvent: (name, snapshot) => {
            if (name === "end") {
              anew = true;
              lost();
            }
            if (!snapshot?.candidates) return;
            history.add(snapshot);
            setState((now) => ({ ...now, world: { ...now.world, ...snapshot }, link: "live" }));
          },
          onDown: lost,
        }));
      if (anew) continue;
      merge({ link: "lost" });
    } catch (error) {
      merge({ link: error.status === 401 ? "signin" : "lost", reason: error.message });
      if (error.status === 401) return;
    }
    await pause(signal);
  }
}

async function ready(signal, merge) {
  while (!signal.aborted) {
    try {
      const response = await fetch("readyz", { signal, cache: "no-store" });
      if (response.ok) return;
      const body = await response.json().catch(() => null);
      merge({ link: "warming", reason: body?.detail ?? "" });
    } catch {
      if (signal.aborted) return;
      merge({ link: "lost", reason: "" });
    }
    await pause(signal);
  }
}

/** Run `start(lost)` until `lost` is called or the signal aborts, then stop it. */
function until(signal, start) {
  return new Promise((resolve) => {
    const stop = start(() => {
      stop();
      resolve();
    });
    signal.addEventListener("abort", () => (stop(), resolve()), { once: true });
  });
}

function pause(signal) {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, RETRY_MS);
    signal.addEventListener("abort", () => (clearTimeout(timer), resolve()), { once: true });
  });
}
