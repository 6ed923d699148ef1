// Verify: does the calibration in force still hold? The last verification, and the control chart since it is in force.
import { html } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { ControlChart } from '../parts/chart.js';
import { HoldButton } from '../parts/hold_button.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { Cause } from '../parts/problem.js';
import { Reasons } from '../parts/reasons.js';
import { ask } from '../state/ask.js';
import { fixed, mm, moment } from '../state/numbers.js';
import { may, note, ready, running } from '../state/now.js';
import { go, linkTo } from '../state/place.js';
import { sentence, t } from '../state/words.js';

export function Verify() {
  const drift = useAsked('/drift', ['drift', 'run', 'applied']);
  const runs = useAsked('/runs?kind=verify&limit=1', ['run']);
  const last = runs.data?.runs.find(({ kind }) => kind === 'verify');
  const begin = async (key) => {
    await ask('/verify', { method: 'POST', body: {}, key });
    note('run');
    go('run');
  };
  const off = !may('operator') || running.value || !ready.value?.calibrate?.ready || drift.data?.calibration_id === null;
  return html`<div class="grid">
    <${Card} title=${t('verify.title')} id="hold"><${Reasons} /><p>${t('verify.about')}</p>
      <${HoldButton} id="hold-verify" label=${t('verify.start')} act=${begin} disabled=${off} why=${t(may('operator') ? 'verify.not-yet' : 'missing.role')} />
    </${Card}>
    <${Card} title=${t('drift.title')} id="drift" wide="2"><${Missing} asked=${drift} />${drift.data && html`<${Drift} drift=${drift.data} />`}</${Card}>
    <${Card} title=${t('verify.last')} id="last" wide="2"><${Missing} asked=${runs} />${runs.data && html`<${Last} run=${last} />`}</${Card}>
    <${Card} title=${t('drift.points')} id="points"><${DriftTable} points=${drift.data?.points ?? []} /></${Card}>
  </div>`;
}

function Drift({ drift }) {
  const sign = { drifting: '▲', steady: '✓', learning: '…', off: '○' }[drift.standing];
  const alarm = drift.alarm && sentence({ ...drift.alarm_detail, message: drift.alarm });
  const left = Math.max(0, drift.rules.learn - drift.verifications);
  return html`<p class="sentence" role="status">${sign} ${t(`standing.${drift.standing}`)}</p>
    ${alarm && html`<p class="note warn" role="alert" lang=${alarm.lang}><span class="mark" aria-hidden="true">!</span> ${alarm.text}</p>`}
    ${drift.standing === 'learning' && html`<p class="quiet">${t('drift.left', { count: left })}</p>`}
    <${ControlChart} points=${drift.points} learn=${drift.rules.learn} limit_mm=${drift.limit_mm} />`;
}

function DriftTable({ points }) {
  if (!points.length) return html`<p class="quiet">${t('drift.none')}</p>`;
  return html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('drift.points')}><table><thead><tr><th scope="col">${t('drift.at')}</th><th scope="col" class="num">${t('drift.average')}</th><th scope="col" class="num">${t('drift.scatter')}</th></tr></thead>
    <tbody>${points.toReversed().map((point) => html`<tr><th scope="row"><a href=${linkTo('run', point.run_id)}>${moment(point.at)}</a></th><td class="num">${mm(point.drift_mm)}</td><td class="num">${mm(point.scatter_mm)}</td></tr>`)}</tbody></table></div>`;
}

/** The target's points as the verification found them against where the calibration puts them: rows of numbers as they come. */
function Last({ run }) {
  if (!run) return html`<p class="quiet">${t('verify.never')}</p>`;
  const found = run.result?.verification;
  return html`<${Facts} rows=${[[t('run.since'), html`<a href=${linkTo('run', run.id)}>${moment(run.created_at)}</a>`], [t('run.state'), t(`state.${run.state}`)]]} />
    ${run.cause && html`<div class="note warn"><${Cause} cause=${run.cause} /></div>`}
    ${found?.points && html`<${CrossTable} points=${found.points} />`}`;
}

function CrossTable({ points }) {
  const cell = (value) => (Array.isArray(value) ? `(${value.map((one) => fixed(one, 2)).join(', ')})` : typeof value === 'number' ? fixed(value, 3) : String(value ?? '—'));
  const names = Object.keys(points[0] ?? {});
  return html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('verify.last')}><table><thead><tr>${names.map((name) => html`<th scope="col" lang="en">${name.replaceAll('_', ' ')}</th>`)}</tr></thead>
    <tbody>${points.map((point) => html`<tr>${names.map((name) => html`<td class="num">${cell(point[name])}</td>`)}</tr>`)}</tbody></table></div>`;
}
