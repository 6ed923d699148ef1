// May I work? One sentence and what to do, what the camera sees, the arm, the accuracy; below: checks, devices, lately.
import { html, useMemo, useState } from '../vendor/preact.js';
import { Bar } from '../parts/bar.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { ControlChart } from '../parts/chart.js';
import { Uncertainty, activator } from '../parts/in_force.js';
import { HeldMove } from '../parts/held_move.js';
import { LivePicture } from '../parts/live_picture.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { MoveArm } from '../parts/move_arm.js';
import { placesOf } from '../parts/places.js';
import { Cause } from '../parts/problem.js';
import { QuickCheck } from '../parts/quick_check.js';
import { Reasons } from '../parts/reasons.js';
import { endedEarly, lastSeenAt, standingOf } from '../parts/standing.js';
import { mm, moment } from '../state/numbers.js';
import { devices, may, old, robot, run, running } from '../state/now.js';
import { ofCamera, readyWith } from '../state/sensors.js';
import { linkTo } from '../state/place.js';
import { deviceName, t } from '../state/words.js';
import { rowsOf } from './history.js';

const LATELY = 4;
const BEFORE = 10; // runs among which the last one of the target is looked for: moves of the arm come between

export function Cell({ moving = false }) {
  const arm = useAsked(ofCamera('/arm'));
  const active = useAsked(ofCamera('/calibrations/current'), ['applied', 'calibration', 'run']);
  const drift = useAsked(ofCamera('/drift'), ['drift', 'applied', 'run']);
  const runs = useAsked(`/runs?limit=${BEFORE}`, ['run']);
  const [seen, setSeen] = useState(null);
  const calibration = active.data?.calibration;
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
  const none = active.error?.status === 404;
  const ended = endedEarly(runs.data?.runs);
  const state = standingOf({ running: running.value, ready: readyWith()?.calibrate, none, drift: drift.data, ended, seen });
  const away = ['away', 'none-away'].includes(state);
  const [back, setBack] = useState(null); // the id of the move back
  const [held, setHeld] = useState(false);
  const views = useAsked(ended && arm.data?.moves ? `/runs/${encodeURIComponent(ended.id)}/views` : null, [], { late: true });
  const to = lastSeenAt(views.data?.views);
  const returning = held || (running.value && run.value.id === back); // its button stays, with the focus on it
  return html`<div class="cockpit cell">
    <${Bar} mark=${SIGNS[state]} sentence=${t(`cell.${state}`)} about=${ABOUT[state](drift.data, to)}>
      ${!returning && html`<${MoveArm} arm=${arm.data} open=${moving} primary=${away && !to} />`}
      ${calibration && !away && !returning && html`<${QuickCheck} />`}
      ${returning ? null : state === 'running' ? html`<a class="button primary" href=${linkTo('run')}>${t('reasons.look')}</a>` : html`<a class="button ${away ? '' : 'primary'}" href=${linkTo('calibrate')}>${t('cell.calibrate')}</a>`}
      ${to && (away || returning) && html`<${HeldMove} id="hold-back" key="back" to=${to} began=${setBack} onHeld=${setHeld} label=${t('held.back')} primary disabled=${!may('operator') || (running.value && !held)} why=${t(may('operator') ? 'move.running' : 'missing.role')} />`}
    </${Bar}>
    <${Card} title=${t('cell.camera')} id="camera" flush><${LivePicture} onSeen=${setSeen} /></${Card}>
    <${Card} title=${arm.data?.model || t('cell.scene')} id="scene" flush><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
    <${Card} title=${t('cell.force')} id="force">
      <${Missing} asked=${active} none=${t('cell.no-force')} />
      ${calibration && html`<${Uncertainty} accuracy=${active.data} limits=${calibration.verdict.limits} brief />
        <${Facts} rows=${[[t('force.since'), moment(active.data.applied.applied_at)], [t('force.by'), activator(active.data.applied.applied_by)]]} />
        <p class="last"><a class="button quiet-button" href=${linkTo('result', calibration.id)}>${t('cell.result')}</a></p>`}
    </${Card}>
    <div class="below">
      <${Card} title=${t('drift.title')} id="drift">${drift.data && html`<${ControlChart} points=${drift.data.points} learn=${drift.data.rules.learn} limit_mm=${drift.data.limit_mm} />`}</${Card}>
      <${Card} title=${t('place.devices')} id="devices"><${DeviceList} /></${Card}>
      <${Card} title=${t('cell.lately')} id="lately"><${Lately} /></${Card}>
    </div>
  </div>`;
}

const SIGNS = { running: '●', 'not-ready': '!', away: '!', 'none-away': '!', looking: '…', none: '1', moved: '▲', unchecked: '✓', good: '✓' };
const ABOUT = {
  running: () => html`<${Reasons} />`, 'not-ready': () => html`<${Reasons} />`, none: () => t('cell.none-about'),
  away: (drift, to) => t(to ? 'cell.back-about' : 'cell.away-about'), 'none-away': (drift, to) => t(to ? 'cell.back-about' : 'cell.away-about'), looking: () => '',
  moved: (drift) => driftWords(drift), unchecked: () => t('cell.unchecked-about'), good: (drift) => driftWords(drift),
};

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

/** The newest events of the cell. */
function Lately() {
  const runs = useAsked(`/runs?limit=${LATELY}`, ['run'], { late: true });
  const calibrations = useAsked(`/calibrations?limit=${LATELY}`, ['calibration', 'applied', 'run'], { late: true });
  const rows = rowsOf(runs.data?.runs, calibrations.data).slice(0, LATELY);
  return html`<ul class="plain lately">${rows.map((row) => html`<li key=${row.key}><a href=${row.link}><span class="quiet">${moment(row.at)}</span> <b>${row.title}</b> ${row.words}</a></li>`)}</ul>`;
}
