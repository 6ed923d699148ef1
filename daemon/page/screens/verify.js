// Check: does the active calibration still hold? The last quick check, the control chart since its activation, touch tests.
import { html } from '../vendor/preact.js';
import { Bar } from '../parts/bar.js';
import { Card, Facts } from '../parts/card.js';
import { ControlChart, TouchChart } from '../parts/chart.js';
import { LivePicture } from '../parts/live_picture.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { MoveArm } from '../parts/move_arm.js';
import { Cause } from '../parts/problem.js';
import { QuickCheck } from '../parts/quick_check.js';
import { Reasons } from '../parts/reasons.js';
import { TouchForm } from '../parts/touch_test.js';
import { TouchResult, signOf, verdictOf } from '../parts/touch_result.js';
import { count, fixed, mm, moment, vector } from '../state/numbers.js';
import { camera, cameras, cameraOf, ofCamera } from '../state/sensors.js';
import { linkTo } from '../state/place.js';
import { sentence, t } from '../state/words.js';

const VERIFICATIONS = 5; // among the newest of them, for each camera, is one that saw the target's points

export function Verify({ argument }) {
  const drift = useAsked(ofCamera('/drift'), ['drift', 'run', 'applied', 'touch', 'acceptance']);
  const runs = useAsked(`/runs?kind=verify&limit=${VERIFICATIONS * Math.max(1, cameras.value.length)}`, ['run']);
  const seen = runs.data?.runs.filter((run) => cameraOf(run) === camera.value) ?? [];
  const last = seen.find(({ kind }) => kind === 'verify');
  const arm = useAsked(ofCamera('/arm'));
  const touching = Boolean(argument); // 'touch', or the id of a touch test
  const way = (address, label) => html`<a class="button chip" href=${linkTo('verify', address)} aria-current=${Boolean(address) === touching ? 'page' : undefined}>${label}</a>`;
  const standing = drift.data && `${SIGNS[drift.data.standing]} ${drift.data.standing === 'learning' ? learningWords(drift.data) : t(`standing.${drift.data.standing}`)}`;
  return html`<div class="cockpit checking">
    <${Bar} sentence=${standing} about=${html`<${Missing} asked=${drift} /><${Reasons} />`}>
      <${MoveArm} arm=${arm.data} />
      <${QuickCheck} primary off=${drift.data?.calibration_id === null} />
    </${Bar}>
    <nav class="row ways" aria-label=${t('place.check')}>${way('', t('verify.title'))}${way('touch', t('touch.title'))}</nav>
    <${Card} title=${t('cell.camera')} id="camera" flush><${LivePicture} /></${Card}>
    ${touching
      ? html`<${Touches} chosen=${argument === 'touch' ? '' : argument} runs=${seen} charted=${drift.data?.touch_tests ?? []} />`
      : html`<div class="side"><${Card} title=${t('drift.title')} id="drift">${drift.data && html`<${Drift} drift=${drift.data} />`}</${Card}>
        <${Card} title=${t('verify.last')} id="last"><${Missing} asked=${runs} />${runs.data && html`<${Last} run=${last} />`}</${Card}>
        <${Card} title=${t('drift.points')} id="points"><${DriftTable} points=${drift.data?.points ?? []} /></${Card}></div>`}
  </div>`;
}

const SIGNS = { drifting: '▲', 'out-of-tolerance': '▲', steady: '✓', learning: '…', off: '○' };

const learningWords = ({ rules, points }) => t('drift.left', { count: Math.max(0, rules.learn - points.filter(({ standing }) => standing === 'learning').length) });

function Drift({ drift }) {
  const alarm = drift.alarm && sentence({ ...drift.alarm_detail, message: drift.alarm });
  return html`
    ${alarm && html`<p class="note warn" role="alert" lang=${alarm.lang}><span class="mark" aria-hidden="true">!</span> ${alarm.text}</p>`}
    <${ControlChart} points=${drift.points} learn=${drift.rules.learn} limit_mm=${drift.limit_mm} />`;
}

function DriftTable({ points }) {
  if (!points.length) return html`<p class="quiet">${t('drift.none')}</p>`;
  const warm = points.some(({ camera_temperature_c }) => camera_temperature_c != null);
  const temperature = ({ camera_temperature_c: value }) => (value == null ? '—' : `${fixed(value, 1)} °C`);
  return html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('drift.points')}><table><thead><tr><th scope="col">${t('drift.at')}</th><th scope="col" class="num">${t('drift.average')}</th><th scope="col" class="num">${t('drift.scatter')}</th>${warm && html`<th scope="col" class="num">${t('drift.temperature')}</th>`}</tr></thead>
    <tbody>${points.toReversed().map((point) => html`<tr><th scope="row"><a href=${linkTo('run', point.run_id)}>${moment(point.at)}</a></th><td class="num">${point.limit_mm === null ? '—' : mm(point.drift_mm)}</td><td class="num">${mm(point.scatter_mm)}</td>${warm && html`<td class="num">${temperature(point)}</td>`}</tr>`)}</tbody></table></div>`;
}

/** Touch tests: a new touch, what the chosen test found, and all tests since the calibration is active. */
function Touches({ chosen, runs, charted }) {
  const list = useAsked('/touches?limit=20', ['touch']);
  const arm = useAsked(ofCamera('/arm'));
  const tests = list.data?.touches ?? [];
  const listed = tests.find(({ id }) => id === chosen);
  const named = useAsked(chosen && list.data && !listed ? `/touches/${encodeURIComponent(chosen)}` : null);
  const shown = chosen ? (listed ?? named.data) : tests[0];
  const verification = runs.find(({ state, result }) => state === 'finished' && result?.verification?.frame === 'base' && result.verification.base_T_flange);
  return html`<div class="side">
    <${Card} title=${t('touch.title')} id="touch">${verification && !list.data
      ? html`<${Missing} asked=${list} />`
      : verification ? html`<${TouchForm} key=${verification.id} verification=${verification} last=${tests[0]} points_mm=${arm.data?.target_points_mm} moves=${arm.data?.moves} />`
      : html`<p>${t('touch.about')}</p><p class="quiet">${t('touch.verify-first')}</p>`}</${Card}>
    <${Card} title=${t('touch.result')} id="touched"><${Missing} asked=${chosen && !listed && list.data ? named : list} none=${t('touch.unknown')} />
      ${list.data && (shown ? html`<${TouchResult} test=${shown} />` : !chosen && html`<p class="quiet">${t('touch.never')}</p>`)}</${Card}>
    <${Card} title=${t('touch.tests')} id="touches"><div class="halves">
      ${charted.length ? html`<${TouchChart} tests=${charted} />` : html`<p class="quiet">${t('touch.none')}</p>`}
      <ul class="timeline">${tests.map((test) => html`<li key=${test.id}><a href=${linkTo('verify', test.id)} aria-current=${test.id === shown?.id ? 'true' : undefined}><span class="sign" aria-hidden="true">${signOf(test.result)}</span>
        <span class="when">${moment(test.created_at)}</span><span class="what">${t(`touch.${verdictOf(test.result)}`, { mm: mm(test.result.tolerance_mm) })} · ${mm(test.result.largest_mm)}</span></a></li>`)}</ul></div>
    </${Card}></div>`;
}

/** What the last verification found. */
function Last({ run }) {
  if (!run) return html`<p class="quiet">${t('verify.never')}</p>`;
  const found = run.result?.verification;
  return html`<${Facts} rows=${[
      [t('run.since'), html`<a href=${linkTo('run', run.id)}>${moment(run.created_at)}</a>`], [t('run.state'), t(`state.${run.state}`)],
      found?.points && [t('verify.within'), html`<b>± ${mm(found.expanded_mm)}</b>`], found?.points && [t('verify.points'), count(found.points.length)],
    ]} />
    ${run.cause && html`<div class="note warn"><${Cause} cause=${run.cause} /></div>`}
    ${found?.points && html`<${CrossTable} found=${found} />`}`;
}

/** Corners and middle of the target: the mean over the positions of the arm, and how far a position lies from it. */
function CrossTable({ found: { points, cross, frame } }) {
  const at = (values) => vector(values, 2);
  const shown = points.filter(({ id }) => cross.includes(id));
  const mean = (places) => [0, 1, 2].map((axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length);
  return html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('verify.last')}><table><thead><tr><th scope="col" class="num">${t('verify.point')}</th><th scope="col" class="num">${t(`verify.mean.${frame}`)}</th><th scope="col" class="num">${t('verify.spread')}</th></tr></thead>
    <tbody>${shown.map((point) => html`<tr key=${point.id}><th scope="row" class="num">${point.id}</th><td class="num">${at(mean(point[`${frame}_mm`]))}</td><td class="num">${at(point.sigma_mm)}</td></tr>`)}</tbody></table></div>`;
}
