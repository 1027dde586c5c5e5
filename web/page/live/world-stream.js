// The live cell as this page knows it: its last snapshot, its recent values, the link to it.
import { useCallback, useEffect, useRef, useState } from "../vendor/htm-preact-standalone.module.js";
import { follow, get, inOrder, post, Problem, put, SIGN_IN, Unreachable, wait } from "../api.js";
import { Lost, Unconfirmed } from "../unconfirmed.js";
import { History } from "./history.js";
import { hidden, seen } from "../visibility.js";

export const WORLD = "main";
const RETRY_MS = 1000;
const ASK_MS = 3000; // time that one question whether the server is ready may take
const LOOK_MS = 250;
const STALE_MS = 2000; // silence after which what is shown counts as stale
const AGAIN_MS = 10000; // silence after which the stream is opened again
const COMMAND_MS = 8000;
const CELL_MS = 180000; // another cell may have kernels to compile

/** Whether the server answers requests. */
export function answers(link) {
  return link === "live" || link === "stalled";
}

/**
 * Follow the server and its world.
 *
 * @returns {{link: "connecting"|"warming"|"live"|"stalled"|"stale"|"lost"|"signin", reason: string,
 *            world: object|null, cell: object|null, cells: object[], history: History,
 *            epoch: number, heardAt: number, pending: number, errors: Error[],
 *            send: (command: object) => Promise<void>, show: (cell: string) => Promise<void>}}
 *   `epoch` counts how often the server was found ready; `heardAt` is the time of the last
 *   snapshot, as performance.now() gives it, or of the page's start; a world is stalled that no
 *   longer moves though the server answers; `reason` is what the server says of its fault, "" if
 *   it does not answer; `cell` is null until the list of cells has been read, which needs the
 *   database; `pending` counts commands that no snapshot shows yet;
 *   `errors` are those of the newest commands.
 */
export function useCell() {
  const [state, setState] = useState(() => ({
    link: "connecting", reason: "", world: null, cell: null, cells: [], heardAt: performance.now(),
  }));
  const [epoch, setEpoch] = useState(0);
  const [errors, setErrors] = useState([]);
  const [pending, setPending] = useState(0);
  const unconfirmed = useRef(new Unconfirmed());
  const history = useRef(new History());
  const shown = useRef(null);
  shown.current = errors;

  useEffect(() => {
    const stop = new AbortController();
    const signIn = () => {
      stop.abort();
      setState((now) => ({ ...now, link: "signin" }));
    };
    watch(stop.signal, history.current, unconfirmed.current, setState, setEpoch);
    addEventListener(SIGN_IN, signIn);
    return () => {
      removeEventListener(SIGN_IN, signIn);
      stop.abort();
    };
  }, []);

  const report = useCallback(async (request) => {
    const before = shown.current;
    setPending((n) => n + 1);
    const own = await request.then(() => [], (problem) => [problem]);
    // Those of commands that were sent meanwhile stay.
    setErrors((now) => [...now.filter((one) => !before.includes(one)), ...own]);
    setPending((n) => n - 1);
  }, []);
  // A command that was not confirmed in time: what the world shows now is the answer.
  useEffect(() => {
    if (state.link === "live") {
      setErrors((now) => now.filter((one) => !(one instanceof Unreachable)));
    }
  }, [state.link]);
  const [posts] = useState(inOrder);
  const send = useCallback((command) => report(carryOut(command, unconfirmed.current, posts)), []);
  const show = useCallback((name) =>
    report(put(`v1/worlds/${WORLD}/cell`, { cell: name }, { patience: CELL_MS })), []);
  const dismiss = () => setErrors([]);
  return { ...state, epoch, pending, history: history.current, send, show, errors, dismiss };
}

/** Send a command; resolves once a snapshot shows its effect, throws if none does in time. */
async function carryOut(command, unconfirmed, posts) {
  const name = command.tag.replaceAll("-", " ");
  try {
    const options = { patience: COMMAND_MS };
    const { number } = await posts(() => post(`v1/worlds/${WORLD}/commands`, command, {}, options));
    await unconfirmed.wait(number, COMMAND_MS);
  } catch (problem) {
    if (problem instanceof Lost) {
      throw new Error(`Effect unknown: ${name}. The connection was lost before the cell `
        + "confirmed it; look at the cell again.");
    }
    if (!(problem instanceof Unreachable)) throw problem;
    throw new Unreachable(`Not confirmed: ${name}. ${problem.message[0].toUpperCase()}${
      problem.message.slice(1)}; the command may still be carried out later.`);
  }
}

/** Wait until ready, then follow the world while the page is seen; for ever. */
async function watch(signal, history, unconfirmed, setState, setEpoch) {
  const merge = (more) => !signal.aborted && setState((now) => ({ ...now, ...more }));
  let isBack = false; // seen again: the scene has its own connection
  let cells = [];
  while (!signal.aborted) {
    await seen(signal);
    let { first, stalled } = await ready(signal, merge);
    isBack &&= first;
    try {
      const [world, listed] = await Promise.all([
        get(`v1/worlds/${WORLD}`), get("v1/cells", { patience: ASK_MS }).catch(() => null),
      ]);
      const showCells = () =>
        merge({ cells, cell: cells.find(({ name }) => name === world.cell) ?? null });
      let replaced = false;
      let link = "lost";
      let fault = null;
      cells = listed?.items ?? cells;
      history.add(world);
      showCells();
      merge({ world, link: stalled ? "stalled" : "live", reason: "" });
      if (!stalled) merge({ heardAt: performance.now() });
      if (!isBack) setEpoch((n) => (stalled ? Math.max(n, 1) : n + 1));
      isBack = false;
      await until(signal, (lost) => {
        const left = new AbortController();
        hidden(left.signal).then(() => left.signal.aborted || lost((isBack = true)));
        if (!listed) {
          cellsLater(left.signal).then((items) => {
            if (left.signal.aborted) return;
            cells = items;
            showCells();
          });
        }
        const silence = listen((quiet) => {
          const still = stalled ? "stalled" : "stale";
          merge({ link: still });
          if (quiet > AGAIN_MS) lost((link = still));
        });
        const leave = follow(`v1/worlds/${WORLD}/events`, {
          onEvent: (name, snapshot) => {
            // The world may have been replaced after its state was read, before the stream began.
            const isOther = snapshot?.candidates
              && (snapshot.cell !== world.cell || snapshot.tick < world.tick);
            if (name === "end" || isOther) return lost((replaced = true));
            if (!snapshot?.candidates || (stalled && snapshot.tick === world.tick)) return;
            stalled = false;
            silence.end();
            history.add(snapshot);
            unconfirmed.see(snapshot);
            const heardAt = performance.now();
            setState((now) => ({
              ...now, world: { ...now.world, ...snapshot }, link: "live", heardAt,
            }));
          },
          onDown: (error) => lost((fault = error)),
        });
        return () => (left.abort(), silence.stop(), leave());
      });
      unconfirmed.drop();
      if (replaced || isBack) continue;
      merge({ link, reason: saidBy(fault) });
    } catch (error) {
      isBack = false;
      if (error.status === 401) return; // the page asks for the token
      merge({ link: error.silent ? "stale" : "lost", reason: saidBy(error) });
    }
    await wait(RETRY_MS, signal);
  }
}

/** What the server says of a request that failed; "" if it has not answered. */
function saidBy(error) {
  return error instanceof Problem ? error.message : "";
}

/** The list of cells, asked for until it is answered; null once the signal aborts. */
async function cellsLater(signal) {
  for (;;) {
    await wait(RETRY_MS, signal);
    if (signal.aborted) return null;
    const listed = await get("v1/cells", { signal }).catch(() => null);
    if (listed) return listed.items;
  }
}

/** Wait until the server is ready; whether it was at the first question, and the world stalled. */
async function ready(signal, merge) {
  for (let first = true; !signal.aborted; first = false) {
    try {
      const late = AbortSignal.any([signal, AbortSignal.timeout(ASK_MS)]);
      const response = await fetch("readyz", { signal: late, cache: "no-store" });
      const body = await response.json().catch(() => null);
      if (response.ok) return { first, stalled: WORLD in (body?.stalled ?? {}) };
      merge({ link: "warming", reason: body?.detail ?? "" });
    } catch (error) {
      if (signal.aborted) break;
      merge({ link: error.name === "TimeoutError" ? "stale" : "lost", reason: "" });
    }
    await wait(RETRY_MS, signal);
  }
  return { first: false, stalled: false };
}

/**
 * Call `onSilence(quiet)` while nothing has been heard for STALE_MS and more, at two looks in a
 * row: what came while the page itself was busy is handled between them.
 */
function listen(onSilence) {
  let heard = performance.now();
  let quietBefore = false;
  const timer = setInterval(() => {
    const quiet = performance.now() - heard;
    if (quiet > STALE_MS && quietBefore) onSilence(quiet);
    quietBefore = quiet > STALE_MS;
  }, LOOK_MS);
  return { end: () => (heard = performance.now()), stop: () => clearInterval(timer) };
}

/** Run `start(lost)` until `lost` is called or the signal aborts, then stop it. */
function until(signal, start) {
  return new Promise((resolve) => {
    const end = () => {
      signal.removeEventListener("abort", end);
      stop();
      resolve();
    };
    const stop = start(end);
    signal.addEventListener("abort", end);
  });
}
