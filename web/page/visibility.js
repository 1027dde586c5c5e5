// Whether somebody sees the page. A browser keeps at most six connections to a server for all its
// tabs (HTTP/1.1), and each open stream occupies one: hidden pages close theirs.

/** Time for which a page stays connected after it was hidden [ms]. */
const HIDDEN_MS = 5000;

/** Resolve once the page is seen, or the signal aborts. */
export function seen(signal) {
  return changed(signal, () => !document.hidden, 0);
}

/** Resolve once the page has been hidden for a while, or the signal aborts. */
export function hidden(signal) {
  return changed(signal, () => document.hidden, HIDDEN_MS);
}

/** Keep what `start` begins while the page is seen; it returns a function that ends it. */
export function whileSeen(start) {
  const over = new AbortController();
  const run = async () => {
    while (!over.signal.aborted) {
      await seen(over.signal);
      if (over.signal.aborted) return;
      const end = start();
      await hidden(over.signal);
      end();
    }
  };
  run();
  return () => over.abort();
}

/** Resolve once `holds` has been true for `ms`, or the signal aborts. */
function changed(signal, holds, ms) {
  return new Promise((resolve) => {
    let timer = null;
    const finish = () => {
      clearTimeout(timer);
      document.removeEventListener("visibilitychange", look);
      signal.removeEventListener("abort", finish);
      resolve();
    };
    const look = () => {
      clearTimeout(timer);
      if (signal.aborted || (holds() && ms === 0)) finish();
      else if (holds()) timer = setTimeout(finish, ms);
    };
    document.addEventListener("visibilitychange", look);
    signal.addEventListener("abort", finish);
    look();
  });
}
