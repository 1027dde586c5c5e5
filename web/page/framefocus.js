// Whether the keyboard is inside the scene's frame. A page cannot style that by itself: no
// focus selector matches a frame whose own document has the focus.
import { useEffect, useState } from "./vendor/htm-preact-standalone.module.js";

const POINTER = ["pointerdown", "pointermove"];

/** True while `frame` has the focus and a key, not the pointer, brought it there. */
export function useFrameFocus(frame) {
  const [keyed, setKeyed] = useState(false);
  useEffect(() => {
    let byKey = false;
    const key = (event) => event.key === "Tab" && (byKey = true);
    const point = () => (byKey = false);
    const look = () => setKeyed(byKey && document.activeElement === frame.current);
    const heard = [["keydown", key], ["blur", look], ["focus", look],
      ...POINTER.map((name) => [name, point])];
    heard.forEach(([name, act]) => addEventListener(name, act));
    return () => heard.forEach(([name, act]) => removeEventListener(name, act));
  }, [frame]);
  return keyed;
}
