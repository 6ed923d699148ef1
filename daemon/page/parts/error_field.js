// Where points are put wrongly by the arm as drawn, and how well the arm as built knows them: two maps seen from above.
import { html } from '../vendor/preact.js';
import { mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { ticks } from './ticks.js';

const SIZE = 320;
const PAD = 34;

/** `field`: { points: [{ base_mm, drawn_mm, expanded_mm }], drawn_rms_mm, expanded_rms_mm } of GET /calibrations/{id}/arm/field. */
export function ErrorField({ field }) {
  const end = Math.max(...field.points.flatMap(({ drawn_mm, expanded_mm }) => [drawn_mm, expanded_mm]));
  return html`<p class="quiet">${t('field.about', { count: field.points.length })}</p>
    <div class="fields">
      <${FieldMap} points=${field.points} value=${(point) => point.drawn_mm} end=${end} title=${t('field.drawn')} rms=${field.drawn_rms_mm} />
      <${FieldMap} points=${field.points} value=${(point) => point.expanded_mm} end=${end} title=${t('field.built')} rms=${field.expanded_rms_mm} />
    </div>`;
}

function FieldMap({ points, value, end, title, rms }) {
  const at = [0, 1].map((axis) => points.map(({ base_mm }) => base_mm[axis]));
  const [low, high] = [at.map((row) => Math.min(...row)), at.map((row) => Math.max(...row))];
  const span = Math.max(high[0] - low[0], high[1] - low[1], 1) * 1.12;
  const middle = low.map((one, axis) => (one + high[axis]) / 2);
  const scale = (SIZE - PAD) / span;
  const x = (mm_) => PAD + (SIZE - PAD) / 2 + (mm_ - middle[0]) * scale;
  const y = (mm_) => (SIZE - PAD) / 2 - (mm_ - middle[1]) * scale;
  const [xTicks, yTicks] = [0, 1].map((axis) => ticks(middle[axis] - span / 2, middle[axis] + span / 2, 4));
  const words = t('field.rms', { mm: mm(rms) });
  return html`<figure class="chart field"><svg viewBox="0 0 ${SIZE} ${SIZE}" role="img" aria-label="${title}: ${words}">
    ${xTicks.map((tick) => html`<path class="grid-line" d="M${x(tick)} 0V${SIZE - PAD}" /><text x=${x(tick)} y=${SIZE - PAD + 16} text-anchor="middle">${tick}</text>`)}
    ${yTicks.map((tick) => html`<path class="grid-line" d="M${PAD} ${y(tick)}H${SIZE}" /><text x=${PAD - 4} y=${y(tick) + 4} text-anchor="end">${tick}</text>`)}
    <text x=${SIZE - 2} y=${SIZE - 2} text-anchor="end">x / mm</text>
    ${points.map((point) => html`<circle class="bubble" cx=${x(point.base_mm[0])} cy=${y(point.base_mm[1])} r=${Math.max(1, 14 * (value(point) / (end || 1)))}><title>${mm(value(point))}</title></circle>`)}
  </svg><figcaption><b>${title}</b><br />${words}</figcaption></figure>`;
}
