// Shown when the server asks for its token: the token is exchanged for a session cookie.
import { html, useState } from "./vendor/htm-preact-standalone.module.js";
import { useAction } from "./action.js";
import { post } from "./api.js";
import { sentence } from "./format.js";
import { Logo } from "./icons.js";

export function SignIn() {
  const [token, setToken] = useState("");
  const { busy, error, run } = useAction(() => location.reload());
  const submit = (event) => {
    event.preventDefault();
    run(() => post("session", { token }));
  };
  return html`<main class="signin"><form class="card" onSubmit=${submit}>
    <h1 class="brand"><${Logo} />Tandem</h1>
    <p>This server is protected. Enter its token, the setting TANDEM_TOKEN of the server.</p>
    <div class="field">
      <label for="token">Token</label>
      <input id="token" type="password" autofocus autocomplete="current-password" value=${token}
        aria-invalid=${String(Boolean(error))} onInput=${(e) => setToken(e.target.value)} />
      ${error && html`<p class="field-error" role="alert">${error.field === "token"
        ? "This is not the token of this server." : sentence(error.message)}</p>`}
    </div>
    <button type="submit" class="primary wide" disabled=${busy}>Open the cell</button>
  </form></main>`;
}
