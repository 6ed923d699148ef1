// Whether a run may start, as a list of what to do first.
import { html } from '../vendor/preact.js';
import { run, running } from '../state/now.js';
import { timeOfDay } from '../state/numbers.js';
import { linkTo } from '../state/place.js';
import { readyWith } from '../state/sensors.js';
import { sentences, t } from '../state/words.js';

export function Reasons({ kind = 'calibrate' }) {
  const now = readyWith()?.[kind];
  if (running.value) {
    const { started_by, created_at, kind: what } = run.value;
    return html`<p class="note info"><span class="mark" aria-hidden="true">i</span> ${t('reasons.running', { what: t(`kind.${what}`), name: started_by ?? '—', at: timeOfDay(created_at) })} <a href=${linkTo('run')}>${t('reasons.look')}</a></p>`;
  }
  if (!now) return html`<p class="quiet">${t('missing.wait')}</p>`;
  if (now.ready) return html`<p><b>✓ ${t('reasons.ready')}</b></p>`;
  return html`<p><b>! ${t('reasons.not')}</b></p><ul class="plain">${sentences(now.reasons, now.reason_details).map(({ text, lang }) => html`<li lang=${lang}>→ ${text}</li>`)}</ul>`;
}
