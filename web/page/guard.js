// A part of the page that fails alone: an error in it does not stop the others.
import { html, useErrorBoundary } from "./vendor/htm-preact-standalone.module.js";
import { sentence } from "./format.js";
import { Alert } from "./icons.js";

export function Guard({ children }) {
  const [error, again] = useErrorBoundary();
  if (!error) return children;
  return html`<${Alert}>${sentence(`This part of the page has failed: ${error.message}`)}
    ${" "}<button type="button" class="text-button" onClick=${again}>Show it again</button></${Alert}>`;
}
