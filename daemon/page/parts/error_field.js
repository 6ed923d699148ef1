// By how much registered points are missed by the arm as drawn, and with its errors taken out: two maps seen from above.
import { html } from '../vendor/preact.js';
import { fixed, mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { ticks } from './ticks.js';

const SIZE = 320;
const PAD = 48;

/** The points above each other as one, with the RMS of their misses: [{ x, y, before_mm, after_mm }] (pure). */
export function columnsOf(points) {
  const above = new Map();
  for (const point of points) {
    const key = point.flange_mm.slice(0, 2).join();
    above.set(key, [...(above.get(key) ?? []), point]);
  }
  const mean = (rows, value) => rows.reduce((sum, row) => sum + value(row), 0) / rows.length;
  return [...above.values()].map((rows) => ({
    x: mean(rows, ({ point_mm }) => point_mm[0]), y: mean(rows, ({ point_mm }) => point_mm[1]),
    before_mm: Math.sqrt(mean(rows, ({ before_mm }) => before_mm ** 2)), after_mm: Math.sqrt(mean(rows, ({ after_mm }) => after_mm ** 2)),
  }));
}

/** `field`: of GET /calibrations/{id}/arm/field. */
export function ErrorField({ field }) {
  const columns = columnsOf(field.points);
  if (!columns.length) return html`<p class="quiet">${t('field.none')}</p>`;
  const end = Math.max(...columns.flatMap(({ before_mm, after_mm }) => [before_mm, after_mm]));
  return html`<p class="quiet">${t('field.about', { count: field.points.length })}</p>
    <div class="fields">
      <${FieldMap} columns=${columns} value=${(one) => one.before_mm} end=${end} title=${t('field.before')} rms=${field.before_rms_mm} />
      <${FieldMap} columns=${columns} value=${(one) => one.after_mm} end=${end} title=${t('field.after')} rms=${field.after_rms_mm} />
    </div>`;
}

function FieldMap({ columns, value, end, title, rms }) {
  const at = ['x', 'y'].map((axis) => columns.map((one) => one[axis]));
  const [low, high] = [at.map((row) => Math.min(...row)), at.map((row) => Math.max(...row))];
  const span = Math.max(high[0] - low[0], high[1] - low[1], 1) * 1.25; // room for the circles at the edge
  const middle = low.map((one, axis) => (one + high[axis]) / 2);
  const scale = (SIZE - PAD) / span;
  const x = (mm_) => PAD + (SIZE - PAD) / 2 + (mm_ - middle[0]) * scale;
  const y = (mm_) => (SIZE - PAD) / 2 - (mm_ - middle[1]) * scale;
  const [xTicks, yTicks] = [0, 1].map((axis) => ticks(middle[axis] - span / 2, middle[axis] + span / 2, 4));
  const words = t('field.rms', { mm: mm(rms) });
  return html`<figure class="chart field"><svg viewBox="0 0 ${SIZE} ${SIZE}" role="img" aria-label="${title}: ${words}">
    ${xTicks.map((tick) => html`<path class="grid-line" d="M${x(tick)} 0V${SIZE - PAD}" /><text x=${x(tick)} y=${SIZE - PAD + 16} text-anchor="middle">${fixed(tick, 0)}</text>`)}
    ${yTicks.map((tick) => html`<path class="grid-line" d="M${PAD} ${y(tick)}H${SIZE}" /><text x=${PAD - 4} y=${y(tick) + 4} text-anchor="end">${fixed(tick, 0)}</text>`)}
    <text x=${SIZE - 2} y=${SIZE - 2} text-anchor="end">x / mm</text>
    ${columns.map((one) => html`<circle class="bubble" cx=${x(one.x)} cy=${y(one.y)} r=${Math.max(1, 16 * (value(one) / (end || 1)))}><title>${mm(value(one))}</title></circle>`)}
  </svg><figcaption><b>${title}</b><br />${words}</figcaption></figure>`;
}
