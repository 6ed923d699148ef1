// The pictures of a run in a row.
import { html } from '../vendor/preact.js';
import { t } from '../state/words.js';
import { Picture } from './picture.js';
import { picturesOf } from './run_times.js';

export const frameOf = (shown, view, width) => `/runs/${encodeURIComponent(shown.id)}/frames/${view.index}?width=${width}`;

/** The pictures of the run in a row: those taken, each a button where one can `choose`; the one that comes; those planned. */
export function Film({ shown, rows, chosen, choose }) {
  const ahead = shown.over ? 0 : Math.max(0, picturesOf(shown).of - rows.length); // the rows are told at another moment
  const words = (index) => t(index === 0 ? `state.${shown.state}` : 'film.planned');
  return html`<ol class="film card" aria-label=${t('views.title')}>
    ${rows.map((view, place) => html`<li key=${place}>${choose ? html`<button type="button" class="taken" aria-pressed=${view.index === chosen} onClick=${() => choose(view.index)}>${taken(shown, view)}</button>` : html`<div class="taken">${taken(shown, view)}</div>`}</li>`)}
    ${Array.from({ length: Math.min(ahead, 12) }, (_, index) => html`<li key=${rows.length + index} class=${index === 0 ? 'next' : 'planned'}>${words(index)}</li>`)}
  </ol>`;
}

const taken = (shown, view) => html`<${Picture} src=${frameOf(shown, view, 240)} size=${view.size ?? undefined} alt="" /><span class="sr-only">${t('view.title', { view: view.index })}</span><b aria-hidden="true">${view.index + 1}</b><span aria-hidden="true">${view.corners?.length ? `✓ ${view.corners.length}` : '✕'}</span>`;
