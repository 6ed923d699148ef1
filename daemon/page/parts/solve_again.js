// The same pictures solved again: without some views, or by another method; a calibration of its own, not active.
import { html, useState } from '../vendor/preact.js';
import { ask, newKey } from '../state/ask.js';
import { note, running } from '../state/now.js';
import { go } from '../state/place.js';
import { t } from '../state/words.js';
import { Act } from './act.js';

const METHODS = ['auto', 'three-pose', 'tsai', 'park', 'horaud', 'daniilidis', 'shah', 'kronecker'];
const LEAST_VIEWS = 3;

/** `views`: [{ index, status }] of the calibration at `path`. */
export function SolveAgain({ path, views }) {
  const [without, setWithout] = useState([]);
  const [method, setMethod] = useState('auto');
  const left = views.length - without.length;
  const toggle = (index) => setWithout(without.includes(index) ? without.filter((one) => one !== index) : [...without, index].sort((a, b) => a - b));
  const solve = async () => {
    const { data } = await ask(`${path}/solve`, { method: 'POST', key: newKey(), body: { without, method }, limit_s: 120 });
    note('calibration');
    go('result', data.id);
  };
  return html`<p class="quiet">${t('again.about')}</p>
    <div class="row views-chosen" role="group" aria-label=${t('again.views')}>${views.map(({ index }) =>
      html`<button type="button" class="chip" key=${index} aria-pressed=${!without.includes(index)} onClick=${() => toggle(index)}>${index + 1}</button>`)}</div>
    <div><label for="again-method">${t('again.method')}</label>
      <select id="again-method" value=${method} onChange=${(event) => setMethod(event.target.value)}>${METHODS.map((name) => html`<option value=${name}>${name === 'auto' ? t('again.auto') : name}</option>`)}</select></div>
    <${Act} label=${t('again.solve')} act=${solve} disabled=${running.value || left < LEAST_VIEWS} />
    <p class="small quiet">${left < LEAST_VIEWS ? t('jog.least') : t('again.left', { count: left, of: views.length })}</p>`;
}
