// What a touch test found: verdict, the misses with U (k = 2), and the largest miss of each test over time.
import { html } from '../vendor/preact.js';
import { fixed, mm, moment, vector } from '../state/numbers.js';
import { linkTo } from '../state/place.js';
import { t } from '../state/words.js';
import { Facts } from './card.js';
import { MissChart } from './chart.js';

const SIGN = { within: '✓', beyond: '✕', undecided: '○', agree: '✓', disagree: '✕' };

/** The word of a verdict: of a tolerance where there is one, else whether the misses agree with what is stated. */
export const verdictOf = ({ conformance, agree }) => conformance ?? (agree ? 'agree' : 'disagree');

/** Its sign. */
export const signOf = (result) => SIGN[verdictOf(result)];

export function TouchResult({ test: { result, created_at, created_by, verification } }) {
  const word = verdictOf(result);
  const worst = result.points.reduce((a, b) => (b.length_mm > a.length_mm ? b : a));
  return html`<p class="sentence">${SIGN[word]} ${t(`touch.${word}`, { mm: mm(result.tolerance_mm) })}</p>
    ${!result.agree && result.conformance !== null && html`<p class="note warn"><span class="mark" aria-hidden="true">!</span> ${t('touch.disagree')}</p>`}
    ${word !== 'within' && word !== 'agree' && html`<p class="quiet">→ ${t(`touch.${word}.fix`)}</p>`}
    <${MissChart} points=${result.points} tolerance_mm=${result.tolerance_mm} />
    <div class="table-frame" tabindex="0" role="group" aria-label=${t('touch.misses')}><table><thead><tr><th scope="col">${t('verify.point')}</th><th scope="col" class="num">${t('touch.miss')}</th><th scope="col" class="num">${t('touch.length')}</th><th scope="col" class="num">${t('touch.known')}</th></tr></thead>
      <tbody>${result.points.map((point) => html`<tr><th scope="row">${pointName(point.name)}${point.outlying ? html` <span class="small">! ${t('touch.outlying')}</span>` : ''}</th><td class="num">${vector(point.miss_mm, 2)}</td><td class="num">${fixed(point.length_mm, 2)}</td><td class="num">± ${fixed(point.expanded_mm, 2)}</td></tr>`)}</tbody></table></div>
    <${Facts} rows=${[
      [t('touch.largest'), html`<b>${mm(worst.length_mm)}</b> ± ${mm(worst.expanded_mm)}`],
      [t('touch.mean'), `${vector(result.mean_mm, 2)} mm`],
      [t('touch.probability'), percent(result.probability)],
      [t('pose.made'), `${moment(created_at)}, ${created_by}`],
      [t('touch.calibration'), html`<a href=${linkTo('result', result.calibration_id)}>${result.calibration_id}</a>`],
      verification && [t('kind.verify'), html`<a href=${linkTo('run', verification)}>${verification}</a>`],
    ]} />`;
}

/** "point 10" of the daemon in words; a name that an operator gave stays. */
export function pointName(name) {
  const [, id] = /^point (\d+)$/.exec(name) ?? [];
  return id === undefined ? name : t('touch.named', { point: id });
}

const percent = (share) => (share < 0.001 ? `< ${fixed(0.1, 1)} %` : `${fixed(100 * share, share < 0.1 ? 1 : 0)} %`);
