// The accuracy of a calibration: U (k = 2) at the worst of the points that matter on its scale, beside what it is judged by.
import { html } from '../vendor/preact.js';
import { mm } from '../state/numbers.js';
import { sentence, t, volumePoint } from '../state/words.js';
import { Facts } from './card.js';
import { Scale } from './scale.js';

/** The name of a point in words, a user's own as it is. */
export function PointName({ name }) {
  const words = volumePoint(name);
  return words ? html`<span>${words}</span>` : html`<span lang="">${name}</span>`;
}

/** Who activated a calibration: a name, or the rule that does it without a person. */
export const activator = (name) => (name === 'policy auto' ? t('force.auto') : name);

/** `accuracy`: expanded_mm, worst_point and so on, of a calibration, a result or a list; `limits`: of its verdict; `brief`: without what was expected. */
export function Uncertainty({ accuracy, limits, brief = false }) {
  const { expanded_mm: U_mm, worst_point: point, tolerance_mm, tolerance_stated, expected_mm, before_mm, why } = accuracy;
  const said = !brief && why && sentence(why);
  const known = (value) => value !== null && value !== undefined;
  return html`<p class="figure">${known(U_mm) ? `± ${mm(U_mm)}` : '—'}</p>
    <p class="quiet">${t('U.of')}${point ? ` · ${t('U.at')} ` : ''}${point && html`<${PointName} name=${point} />`}</p>
    ${known(tolerance_mm) && html`<${Scale} value=${U_mm} warning=${Math.min(limits?.point_warning_mm ?? tolerance_mm, tolerance_mm)} limit=${tolerance_mm} />`}
    <${Facts} rows=${[
      known(tolerance_mm) && [t('U.tolerance'), `± ${mm(tolerance_mm)}${tolerance_stated ? '' : ` · ${t('U.not-stated')}`}`],
      !brief && known(expected_mm) && [t('U.expected'), `± ${mm(expected_mm)}`],
      known(before_mm) && [t('U.before'), `± ${mm(before_mm)}`],
    ]} />
    ${said && html`<p class="quiet" lang=${said.lang}>${said.text}</p>`}`;
}
