// The keyboard's focus in a section whose rows and buttons leave: it stays in the section.
import { useEffect, useRef } from "./vendor/htm-preact-standalone.module.js";

const ROW = "li[data-job], li[data-checkpoint]";

/**
 * Returns the `ref` of a section. Where its focused element is gone, the head of the element's row gets the
 * focus; where the row is, the next one's, the one's before, or else the first element that matches `rest`.
 */
export function useListFocus(rest = "h2") {
  const section = useRef(null);
  useEffect(() => {
    const box = section.current;
    let [last, row] = [null, null];
    const note = ({ target }) => {
      last = box.contains(target) ? target : null;
      row = last?.closest(ROW) ?? null;
    };
    const move = (records) => {
      if (!last || last.isConnected || document.activeElement !== document.body) return;
      const gone = records.find(({ removedNodes }) => [...removedNodes].includes(row));
      const near = row?.isConnected ? row
        : [gone?.nextSibling, gone?.previousSibling].find((one) => one?.isConnected && one.matches?.(ROW));
      (near?.querySelector(".job-head") ?? box.querySelector(rest))?.focus();
    };
    const observer = new MutationObserver(move);
    document.addEventListener("focusin", note);
    observer.observe(box, { childList: true, subtree: true });
    return () => {
      document.removeEventListener("focusin", note);
      observer.disconnect();
    };
  }, []);
  return section;
}
