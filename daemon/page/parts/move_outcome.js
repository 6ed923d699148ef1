// What became of a move that was asked for here.
import { html } from '../vendor/preact.js';
import { run, running } from '../state/now.js';
import { t } from '../state/words.js';
import { useAsked } from './loaded.js';
import { Cause } from './problem.js';

/** The run with the id `last`, as far as it is known; null before the first one. */
export function useMove(last) {
  const asked = useAsked(last && `/runs/${encodeURIComponent(last)}`, ['run'], { late: true });
  return running.value && run.value.id === last ? run.value : asked.data;
}

export function MoveOutcome({ run: shown }) {
  const sign = { finished: '✓', failed: '✕', aborted: '■' }[shown.state] ?? '●';
  return html`<p role="status"><b>${sign} ${t(shown.state === 'finished' ? 'move.done' : shown.over ? `state.${shown.state}` : 'move.moving')}</b></p>
    ${shown.cause && html`<div class="note warn"><${Cause} cause=${shown.cause} /></div>`}`;
}
