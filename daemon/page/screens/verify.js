// Verify: does the calibration in force still hold? The last verification, and the control chart since it is in force.
import { html } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { ControlChart } from '../parts/chart.js';
import { HoldButton } from '../parts/hold_button.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { Cause } from '../parts/problem.js';
import { Reasons } from '../parts/reasons.js';
import { ask } from '../state/ask.js';
import { count, fixed, mm, moment } from '../state/numbers.js';
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

/** What the last verification found. */
function Last({ run }) {
  if (!run) return html`<p class="quiet">${t('verify.never')}</p>`;
  const found = run.result?.verification;
  return html`<${Facts} rows=${[[t('run.since'), html`<a href=${linkTo('run', run.id)}>${moment(run.created_at)}</a>`], [t('run.state'), t(`state.${run.state}`)]]} />
    ${run.cause && html`<div class="note warn"><${Cause} cause=${run.cause} /></div>`}
    ${found?.points && html`<${CrossTable} found=${found} />`}`;
}

/** Corners and middle of the target: the mean over the positions of the arm, and how far a position lies from it. */
function CrossTable({ found: { points, cross, frame, expanded_mm } }) {
  const at = (values) => `(${values.map((one) => fixed(one, 2)).join(', ')})`;
  const shown = points.filter(({ id }) => cross.includes(id));
  const mean = (places) => [0, 1, 2].map((axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length);
  return html`<${Facts} rows=${[[t('verify.within'), html`<b>± ${mm(expanded_mm)}</b>`], [t('verify.points'), count(points.length)]]} />
    <div class="table-frame" tabindex="0" role="group" aria-label=${t('verify.last')}><table><thead><tr><th scope="col" class="num">${t('verify.point')}</th><th scope="col" class="num">${t(`verify.mean.${frame}`)}</th><th scope="col" class="num">${t('verify.spread')}</th></tr></thead>
    <tbody>${shown.map((point) => html`<tr key=${point.id}><th scope="row" class="num">${point.id}</th><td class="num">${at(mean(point[`${frame}_mm`]))}</td><td class="num">${at(point.sigma_mm)}</td></tr>`)}</tbody></table></div>`;
}
