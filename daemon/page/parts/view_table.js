// The views of a run or a result; one is chosen, whose picture is shown beside.
import { html } from '../vendor/preact.js';
import { count, fixed } from '../state/numbers.js';
import { sentence, t } from '../state/words.js';
import { Bar } from './chart.js';

/** `rows`: [{ index, corners?, status?, reason_detail?, rms_px?, base_error_mm?, robot_mm? }]. */
export function ViewTable({ rows, chosen, choose, result = false }) {
  const most = (name) => Math.max(...rows.map((row) => row[name] ?? 0));
  const [px, mm, robot] = ['rms_px', 'base_error_mm', 'robot_mm'].map(most);
  return html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('views.title')}><table class="views">
    <thead><tr><th scope="col">${t('views.view')}</th><th scope="col">${t('views.status')}</th>
      ${!result && html`<th scope="col" class="num">${t('views.corners')}</th>`}
      <th scope="col">${t('views.px')}</th>${result && html`<th scope="col">${t('views.mm')}</th><th scope="col">${t('views.robot')}</th>`}</tr></thead>
    <tbody>${rows.map((row) => html`<tr key=${row.index} class=${row.index === chosen ? 'chosen' : ''}>
      <th scope="row"><button type="button" class="row-button" aria-pressed=${row.index === chosen} onClick=${() => choose(row.index)}>${row.index + 1}</button></th>
      <td><${Status} row=${row} /></td>
      ${!result && html`<td class="num">${row.corners ? count(row.corners.length) : '—'}</td>`}
      <td><${Bar} value=${row.rms_px} end=${px} text=${fixed(row.rms_px, 3)} /></td>
      ${result && html`<td><${Bar} value=${row.base_error_mm} end=${mm} text=${fixed(row.base_error_mm, 3)} /></td>
        <td><${Bar} value=${row.robot_mm} end=${robot} text=${fixed(row.robot_mm, 3)} /></td>`}
    </tr>`)}</tbody></table></div>`;
}

function Status({ row }) {
  const { status, reason_detail, reason, missing } = row;
  const told = reason_detail ?? (missing && { ...missing, message: missing.what });
  const why = told ? sentence(told) : { text: reason ?? '', lang: 'en' };
  const sign = { used: '✓', corrected: '↻', rejected: '✕', missed: '✕' }[status] ?? '';
  return html`<span>${sign} ${status ? t(`status.${status}`) : row.corners?.length ? t('status.seen') : t('status.unseen')}</span>
    ${why.text && html`<span class="small quiet" lang=${why.lang}> ${why.text}</span>`}`;
}
