// The keyboard's focus in a list whose rows and buttons leave: it stays in the list.
import { useEffect, useRef } from "../vendor/htm-preact-standalone.module.js";

const ROW = "li[data-job], li[data-checkpoint]";

/**
 * Returns the `ref` of a section with a heading and rows. Where the focused element of a row is gone, the
 * row's head gets the focus; where the row is, the next one's, the one's before, or else the heading.
 */
export function useListFocus() {
  const section = useRef(null);
  useEffect(() => {
    const box = section.current;
    let [last, row] = [null, null];
    const note = ({ target }) => {
      last = target;
      row = box.contains(target) ? target.closest(ROW) : null;
    };
    const move = (records) => {
      if (!row || last.isConnected || document.activeElement !== document.body) return;
      const gone = records.find(({ removedNodes }) => [...removedNodes].includes(row));
      const near = row.isConnected ? row
        : [gone?.nextSibling, gone?.previousSibling].find((one) => one?.isConnected && one.matches?.(ROW));
      (near?.querySelector(".job-head") ?? box.querySelector("h2")).focus();
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
