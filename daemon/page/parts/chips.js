// One of a few values, each a button.
import { html } from '../vendor/preact.js';

export function Chips({ label, values, chosen, text, choose }) {
  return html`<div class="chips" role="group" aria-label=${label}><span class="small quiet" aria-hidden="true">${label}</span>
    <div class="row">${values.map((value) => html`<button type="button" class="chip" key=${value} aria-pressed=${value === chosen} onClick=${() => choose(value)}>${text(value)}</button>`)}</div></div>`;
}
