// What this window shows over the scene. The viewer in the frame tells what can be shown or
// hidden; what was chosen here is kept for this window, and sent to every new viewer.
import { html, useEffect, useRef, useState } from "./vendor/htm-preact-standalone.module.js";
import { Icon } from "./icons.js";
import { keep, kept } from "./kept.js";

const KEPT = "tandem-view";
const HELP = {
  "Collision shapes": "The capsules with which the simulator measures distances",
  Values: "What the critic expects at each goal",
  "Target line": "From the tool to the chosen goal",
  "Risk map": "Probability of a contact by the place where the first person stands",
  "Failure probabilities": "How often a grasp fails at each clutter slot",
  Goal: "The blocks that the towers still lack",
  Move: "From where the block is taken to where it goes",
  "Separation zone": "Where a person is nearer than the rule asks for",
  Trail: "Where the tool has been",
  Targets: "The goals that policies are trained on",
};

/** The menu over the scene; `frame` is a reference to the viewer's frame. */
export function ViewMenu({ frame }) {
  const [items, setItems] = useState([]);
  const [open, setOpen] = useState(false);
  const box = useRef(null);
  const set = (name, shown) =>
    frame.current?.contentWindow.postMessage({ tag: "set-view", name, shown }, location.origin);
  useEffect(() => {
    const listen = ({ source, data }) => {
      if (source !== frame.current?.contentWindow || data?.tag !== "view-settings") return;
      setItems(data.items);
      const wanted = kept("sessionStorage", KEPT) ?? {};
      for (const { name, shown } of data.items) {
        if ((wanted[name] ?? shown) !== shown) set(name, wanted[name]);
      }
    };
    addEventListener("message", listen);
    return () => removeEventListener("message", listen);
  }, [frame]);
  useEffect(() => {
    if (!open) return undefined;
    const inside = (one) => one instanceof Node && box.current?.contains(one);
    const away = (event) => inside(event.target) || setOpen(false);
    const key = (event) => {
      if (event.key !== "Escape") return;
      setOpen(false);
      box.current.querySelector("button").focus();
    };
    const heard = [["pointerdown", away], ["keydown", key], ["blur", away]];
    heard.forEach(([name, act]) => addEventListener(name, act));
    return () => heard.forEach(([name, act]) => removeEventListener(name, act));
  }, [open]);
  if (items.length === 0) return null;
  const pick = (name, shown) => {
    keep("sessionStorage", KEPT, { ...kept("sessionStorage", KEPT), [name]: shown });
    setItems((now) => now.map((one) => (one.name === name ? { name, shown } : one)));
    set(name, shown);
  };
  return html`<div class="view-menu" ref=${box}>
    <button type="button" class="tool" aria-expanded=${String(open)} data-action="view"
      onClick=${() => setOpen(!open)}><${Icon} name="eye" />View</button>
    ${open && html`<div class="view-items" role="group" aria-label="Shown over the scene">
      ${items.map(({ name, shown }) => html`<label key=${name} title=${HELP[name] ?? ""}>
        <input type="checkbox" checked=${shown} data-view=${name}
          onChange=${(e) => pick(name, e.target.checked)} />${name}</label>`)}
    </div>`}
  </div>`;
}
