// The state of the cell: the arm in 3D, what the camera sees, what is in force, whether a run may start, devices.
import { html, useMemo } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { Uncertainty } from '../parts/in_force.js';
import { LivePicture } from '../parts/live_picture.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { placesOf } from '../parts/places.js';
import { Cause } from '../parts/problem.js';
import { Reasons } from '../parts/reasons.js';
import { mm, moment } from '../state/numbers.js';
import { devices, old, robot } from '../state/now.js';
import { ofCamera } from '../state/sensors.js';
import { linkTo } from '../state/place.js';
import { deviceName, t } from '../state/words.js';

export function Cell() {
  const arm = useAsked(ofCamera('/arm'));
  const inForce = useAsked(ofCamera('/calibrations/current'), ['applied', 'calibration', 'run']);
  const drift = useAsked(ofCamera('/drift'), ['drift', 'applied', 'run']);
  const calibration = inForce.data?.calibration;
  const now = robot.value;
  const places = placesOf(calibration, now?.base_T_flange);
  const parts = useMemo(
    () => ({
      skeleton_mm: now?.skeleton_mm,
      flange_mm: now?.base_T_flange?.translation_mm,
      box_mm: arm.data?.box_mm,
      outline_mm: arm.data?.target_points_mm,
      target: places.target,
      here: places.camera,
    }),
    [now, arm.data, calibration],
  );
  return html`<div class="grid">
    <${Card} title=${t('cell.scene')} id="scene" wide="2"><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
    <${Card} title=${t('cell.force')} id="force">
      <${Missing} asked=${inForce} none=${t('cell.no-force')} />
      ${calibration && html`<${Uncertainty} accuracy=${inForce.data} limits=${calibration.verdict.limits} />
        <${Facts} rows=${[
          [t('force.since'), moment(inForce.data.applied.applied_at)],
          [t('force.by'), inForce.data.applied.applied_by],
          drift.data && [t('place.verify'), driftWords(drift.data)],
        ]} />
        <p><a class="button" href=${linkTo('result', calibration.id)}>${t('place.result')}</a></p>`}
      ${!calibration && inForce.error?.status === 404 && html`<p><a class="button primary" href=${linkTo('calibrate')}>${t('place.calibrate')}</a></p>`}
    </${Card}>
    <${Card} title=${t('cell.camera')} id="camera"><${LivePicture} /></${Card}>
    <${Card} title=${t('cell.ready')} id="ready">
      <${Reasons} />
      <p><a class="button" href=${linkTo('calibrate')}>${t('place.calibrate')}</a></p>
    </${Card}>
    <${Card} title=${t('place.devices')} id="devices"><${DeviceList} /></${Card}>
  </div>`;
}

export function driftWords({ standing, shift_mm, limit_mm }) {
  const sign = { drifting: '▲', 'out-of-tolerance': '▲', steady: '✓', learning: '…', off: '○' }[standing];
  return `${sign} ${t(`standing.${standing}`)}${standing === 'off' ? '' : `, ${mm(shift_mm)}${limit_mm ? ` / ${mm(limit_mm)}` : ''}`}`;
}

const DeviceList = () =>
  html`<ul class="plain devices ${old.value ? 'dimmed' : ''}">${devices.value.map(({ name, kind, connected, detail, last_error }) => html`<li>
    <b><span aria-hidden="true">${connected ? '●' : '✕'}</span> ${deviceName(name ?? kind)}</b> <span>${t(connected ? 'device.up' : 'device.down')}</span>
    ${!connected && (last_error ? html`<${Cause} cause=${last_error} />` : html`<p class="small quiet" lang="en">${detail}</p>`)}
  </li>`)}</ul>
  <p><a href=${linkTo('devices')}>${t('cell.devices')}</a></p>`;
