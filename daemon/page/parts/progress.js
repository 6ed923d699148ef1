// How far something is: a bar, and the same in words.
import { html } from '../vendor/preact.js';
import { fixed } from '../state/numbers.js';
import { t } from '../state/words.js';

/** `share` 0 to 1; `words`: the id of a sentence with {percent}, and its other parameters. */
export function Progress({ share, words: [id, params] }) {
  const sentence = t(id, { ...params, percent: fixed(100 * share, 0) });
  return html`<div class="sent"><progress max="1" value=${share} aria-label=${sentence}></progress><span class="small quiet">${sentence}</span></div>`;
}
