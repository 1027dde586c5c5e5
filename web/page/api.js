// The service as this page uses it: JSON requests, RFC 9457 problems, resumable event streams.

/** An answer that is not 2xx, with the members of its problem document. */
export class Problem extends Error {
  constructor(status, body) {
    super(body?.detail || body?.title || `the server answered ${status}`);
    this.status = status;
    this.title = body?.title || "";
    this.field = body?.field || null;
    this.rule = body?.rule || null;
    this.choices = body?.choices || [];
    this.errors = body?.errors || [];
  }
}

/** No answer at all: the server is away or has stopped. */
export class Unreachable extends Error {}

/** Event of the window when the server no longer takes the page's token. */
export const SIGN_IN = "tandem-sign-in";

let aheadMs = 0;

/** The time of the server [ms], from the last answer: the clock of this machine may be wrong. */
export function serverTime() {
  return Date.now() - aheadMs;
}

const ANSWER_MS = 15000;
const FILE_MS = 180000;
const QUIET_MS = 45000; // silence after which a stream is lost: the server writes every 15 s

/**
 * Send one request, a body as JSON; resolves to the JSON answer, throws Problem or Unreachable,
 * the latter also when nothing has come after `patience` milliseconds.
 */
export function request(path, { body, headers = {}, ...options } = {}) {
  if (body === undefined) return send(path, { headers, ...options });
  headers = { "Content-Type": "application/json", ...headers };
  return send(path, { headers, body: JSON.stringify(body, asText), ...options });
}

/** Numbers beyond those of JSON go as text, so that the service refuses them: null is a value. */
function asText(_, value) {
  return typeof value === "number" && !Number.isFinite(value) ? String(value) : value;
}

async function send(path, { method = "GET", body, headers, signal, patience = ANSWER_MS }) {
  let response;
  let json;
  const late = AbortSignal.timeout(patience);
  try {
    response = await fetch(path, {
      method,
      signal: signal ? AbortSignal.any([signal, late]) : late,
      cache: "no-store",
      headers,
      body,
    });
    const sent = Date.parse(response.headers.get("date"));
    if (Number.isFinite(sent)) aheadMs = Date.now() - sent;
    json = await response.json().catch((error) => {
      if (error instanceof SyntaxError) return null;
      throw error;
    });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    if (error.name === "TimeoutError") {
      const text = `the server did not answer within ${Math.round(patience / 1000)} s`;
      throw Object.assign(new Unreachable(text), { silent: true });
    }
    throw new Unreachable("the server does not answer");
  }
  if (response.status === 401) dispatchEvent(new Event(SIGN_IN));
  if (!response.ok) throw new Problem(response.status, json);
  return json;
}

export const get = (path, options) => request(path, options);
export const put = (path, body = {}, options = {}) =>
  request(path, { method: "PUT", body, ...options });
export const patch = (path, body = {}, options = {}) =>
  request(path, { method: "PATCH", body, ...options });
export const remove = (path) => request(path, { method: "DELETE" });
export const post = (path, body = {}, headers = {}, options = {}) =>
  request(path, { method: "POST", body, headers, ...options });
/** Post a file as it is. */
export const postFile = (path, file) => send(path, {
  method: "POST", body: file, headers: { "Content-Type": "application/octet-stream" },
  patience: FILE_MS,
});

/**
 * A question that can be asked again at any time, answered one at a time: asked again before its
 * answer has come, it is sent once more after it. No answer is overtaken by an older one.
 *
 * @param {() => Promise<void>} ask sends the question, handles its answer and never fails
 */
export function inTurn(ask) {
  let [asking, again] = [false, false];
  const run = async () => {
    again = true;
    if (asking) return;
    for (asking = true; again;) {
      again = false;
      await ask();
    }
    asking = false;
  };
  return { run, isAsking: () => asking };
}

/** Requests that wait for each other, so that the server gets them in the order of the clicks. */
export function inOrder() {
  let before = Promise.resolve();
  return (ask) => {
    const sent = before.then(ask);
    before = sent.catch(() => {});
    return sent;
  };
}

/**
 * Follow a server-sent event stream, for good: after a loss it connects again and resumes
 * after the last event it saw (Last-Event-ID). EventSource cannot do that once a server has
 * answered an error, so the stream is read through fetch.
 *
 * @param {string} path
 * @param {{onEvent: (name: string, data: any, id: string) => void,
 *          onUp?: () => void, onDown?: (error: Error) => void, lastId?: string}} options
 * @returns {() => void} stops following
 */
export function follow(path, { onEvent, onUp = () => {}, onDown = () => {}, lastId = "" }) {
  const stop = new AbortController();
  let id = lastId;
  let pause = 500;
  const run = async () => {
    while (!stop.signal.aborted) {
      try {
        const headers = { Accept: "text/event-stream", ...(id && { "Last-Event-ID": id }) };
        const response = await fetch(path, { headers, signal: stop.signal, cache: "no-store" });
        if (response.status === 404) throw Object.assign(new Problem(404, null), { final: true });
        if (!response.ok) throw new Problem(response.status, null);
        onUp();
        pause = 500;
        const ended = await read(response.body, stop.signal, (event) => {
          if (event.id) id = event.id;
          if (event.data) onEvent(event.name || "message", parse(event.data), event.id);
          return event.name === "end";
        });
        if (ended) return;
        throw new Unreachable("the stream ended");
      } catch (error) {
        if (stop.signal.aborted || error.final) return;
        onDown(error);
      }
      await wait(pause, stop.signal);
      pause = Math.min(pause * 1.6, 4000);
    }
  };
  run();
  return () => stop.abort();
}

/** Read one response body as events until it ends; true when `handle` says it is over. */
async function read(body, signal, handle) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  const leave = () => void reader.cancel().catch(() => {});
  signal.addEventListener("abort", leave, { once: true });
  let rest = "";
  for (;;) {
    const quiet = setTimeout(leave, QUIET_MS);
    const { value, done } = await reader.read();
    clearTimeout(quiet);
    if (done) return false;
    const blocks = (rest + value).replace(/\r\n?/g, "\n").split("\n\n");
    rest = blocks.pop();
    for (const block of blocks) {
      if (handle(fields(block))) {
        leave();
        return true;
      }
    }
  }
}

function fields(block) {
  const event = { name: "", id: "", data: "" };
  for (const line of block.split("\n")) {
    const [, key, text] = /^(\w+):? ?(.*)$/.exec(line) || [];
    if (key === "event") event.name = text;
    else if (key === "id") event.id = text;
    else if (key === "data") event.data += (event.data && "\n") + text;
  }
  return event;
}

function parse(text) {
  try {
    return JSON.parse(text);
  } catch {
    return text;
  }
}

/** Wait, no longer than until the signal aborts. */
export function wait(ms, signal) {
  return new Promise((resolve) => {
    const end = () => {
      clearTimeout(timer);
      signal.removeEventListener("abort", end);
      resolve();
    };
    const timer = setTimeout(end, ms);
    signal.addEventListener("abort", end);
  });
}
