// The page's few icons, drawn on a 16 px grid with 1.5 px strokes.
import { html } from "./vendor/htm-preact-standalone.module.js";

const PATHS = {
  play: "M5 3.5v9l7.5-4.5z",
  pause: "M5.5 3.5v9M10.5 3.5v9",
  step: "M4 3.5v9l6-4.5zM12.5 3.5v9",
  reset: "M3 3.5v3.2h3.2M3.4 6.7A5 5 0 1 1 3 9.2",
  hand: "M5.2 8.2V4.1a.95.95 0 0 1 1.9 0V7M7.1 6.6V2.9a.95.95 0 0 1 1.9 0v3.8M9 6.8V3.7a.95.95 0 0 1 1.9 0v4.1M10.9 7.4V5.6a.95.95 0 0 1 1.9 0v4c0 2.4-1.7 4-3.9 4-2 0-2.9-.8-3.8-2.4L3.3 8.7c-.5-.9.6-1.7 1.3-1z",
  walk: "M8.6 2.2a1 1 0 1 0 .01 0M8.2 5.6 6.8 9.4l2.4 1.7.6 3.1M6.8 9.4l-.6 2-2 2.4M8.2 5.6 5.6 6.8l-.7 2M8.2 5.6l1.5 2 2.1.6",
  film: "M3 3.5h10v9H3zM5.5 3.5v9M10.5 3.5v9M3 8h10",
  stand: "M8 2.2a1 1 0 1 0 .01 0M8 5.4v4M8 9.4v4.2M6.2 6.2 8 5.4l1.8.8v3.2M6.2 6.2v3.2",
  ruler: "M5 2.5h6v11H5zM5 5.2h2.4M5 8h3.4M5 10.8h2.4",
  eye: "M1.8 8S4 3.8 8 3.8 14.2 8 14.2 8 12 12.2 8 12.2 1.8 8 1.8 8zM8 6.2a1.8 1.8 0 1 0 .01 0",
  check: "M3.5 8.5l3 3 6-7",
  alert: "M8 2.5 14 13H2zM8 6.5v3M8 11.2v.1",
  close: "M4 4l8 8M12 4l-8 8",
  plus: "M8 3v10M3 8h10",
  chevron: "M6 4l4 4-4 4",
  external: "M6 3.5H3.5v9h9V10M9 3.5h3.5V7M12.5 3.5 7.5 8.5",
};

export function Icon({ name, filled = false }) {
  return html`<svg class="icon" viewBox="0 0 16 16" aria-hidden="true" focusable="false"
    fill=${filled ? "currentColor" : "none"} stroke="currentColor" stroke-width="1.5"
    stroke-linecap="round" stroke-linejoin="round"><path d=${PATHS[name]} /></svg>`;
}

export function Logo() {
  return html`<svg class="logo" viewBox="0 0 32 32" aria-hidden="true" focusable="false"
    fill="none" stroke-width="3">
    <circle cx="11.6" cy="16" r="7.4" stroke="currentColor" />
    <circle cx="20.4" cy="16" r="7.4" class="logo-second" />
    <path d="M16 10.05a7.4 7.4 0 0 1 0 11.9" stroke="currentColor" />
  </svg>`;
}

/** A button with a cross; `label` says what it does, to the pointer and to screen readers. */
export function Close({ label, ...rest }) {
  return html`<button type="button" class="quiet-button" aria-label=${label} title=${label}
    ...${rest}><${Icon} name="close" /></button>`;
}

/** The notice of a fault. */
export function Alert({ children }) {
  return html`<p class="notice bad" role="alert"><${Icon} name="alert" /><span>${children}</span></p>`;
}
