// The frame with the 3D scene. The frame loads itself again when its drawing or its connection
// has ended (viewer_extra.html); what it says about that is shown over it.
import { html, useEffect, useRef, useState } from "./vendor/htm-preact-standalone.module.js";
import { sentence } from "./format.js";
import { Close } from "./icons.js";

const MUTE_MS = 20000; // time without a word of the frame after which it is loaded again
const NOTE_MS = 20000;

/**
 * @param {string} src Address of the viewer.
 * @param {number} epoch How often the server was found ready.
 * @param {string} link State of the link to the server.
 * @param {object} frame Ref that the frame is given to.
 */
export function Viewer({ src, epoch, link, frame }) {
  const [round, setRound] = useState(0);
  const [report, setReport] = useState({ state: "", reason: "" });
  const [note, setNote] = useState("");
  const died = useRef(""); // why the frame stopped, until it draws again
  const again = () => {
    setReport({ state: "", reason: "" });
    setRound((n) => n + 1);
  };

  useEffect(() => {
    const hear = ({ data, origin, source }) => {
      const ours = origin === location.origin && source === frame.current?.contentWindow;
      if (!ours || data?.from !== "tandem-scene") return;
      setReport(data);
      if (data.state === "dead") died.current ||= data.reason;
      if (data.state !== "up" || !died.current) return;
      setNote(died.current);
      died.current = "";
    };
    addEventListener("message", hear);
    return () => removeEventListener("message", hear);
  }, [frame]);

  // The link was lost: the frame's own connection may hang without having noticed.
  useEffect(() => {
    if (epoch > 1 && report.state === "up") again();
  }, [epoch]);

  // The frame shows an error page, or its script did not get as far as to speak.
  const mute = link === "live" && !["loading", "up"].includes(report.state);
  useEffect(() => {
    if (!mute) return undefined;
    const timer = setTimeout(again, MUTE_MS);
    return () => clearTimeout(timer);
  }, [mute, report, round]);

  useEffect(() => {
    if (!note) return undefined;
    const timer = setTimeout(() => setNote(""), NOTE_MS);
    return () => clearTimeout(timer);
  }, [note]);

  const text = link === "live" ? trouble(report, died.current) : null;
  return html`<iframe key=${round} ref=${frame} src=${src} data-role="viewer"
      data-state=${report.state} title="Live 3D view of robot and person"></iframe>
    ${text && html`<div class="veil" role="status" data-role="scene-trouble">
      <i class="spinner"></i><p><b>${text[0]}</b></p><p class="faint">${text[1]}</p></div>`}
    ${note && html`<p class="scene-note" role="status" data-role="scene-note">
      <span>The 3D scene had stopped (${note}) and was loaded again.</span>
      <${Close} label="Dismiss" onClick=${() => setNote("")} /></p>`}`;
}

/** What to say over the scene: a title and a sentence, or null while it is well. */
function trouble({ state, reason }, died) {
  if (state === "dead" || (state === "loading" && died)) {
    return ["The 3D scene has stopped", "It is being loaded again. The robot goes on meanwhile."];
  }
  if (state !== "closed") return null;
  if (reason) return ["The 3D scene cannot be shown", sentence(reason)];
  return ["The 3D scene is being connected again", "The robot goes on meanwhile."];
}
