// Jog: one small move of the arm at a time, by axis, along or about a frame, or of all axes to their angles; each held.
import { html, useMemo, useState } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { JogControls } from '../parts/jog_controls.js';
import { LivePicture } from '../parts/live_picture.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { MoveOutcome, useMove } from '../parts/move_outcome.js';
import { placesOf } from '../parts/places.js';
import { Reasons } from '../parts/reasons.js';
import { ask } from '../state/ask.js';
import { note, old, robot, run, running } from '../state/now.js';
import { ofCamera, readyWith } from '../state/sensors.js';
import { fixed, vector } from '../state/numbers.js';
import { t } from '../state/words.js';

export function Jog() {
  const arm = useAsked(ofCamera('/arm'));
  const inForce = useAsked(ofCamera('/calibrations/current'), ['applied']);
  const [last, setLast] = useState(null); // the id of the jog that was begun here
  const now = robot.value;
  const places = placesOf(inForce.data?.calibration, now?.base_T_flange);
  const parts = useMemo(() => ({
    skeleton_mm: now?.skeleton_mm, flange_mm: now?.base_T_flange?.translation_mm, box_mm: arm.data?.box_mm,
    outline_mm: arm.data?.target_points_mm, target: places.target, here: places.camera,
  }), [now, arm.data, inForce.data]);
  const send = async (body, key) => {
    const { data } = await ask('/robot/jog', { method: 'POST', key, body });
    setLast(data.id);
    note('run');
  };
  return html`<div class="grid jogging">
    <${Card} title=${t('move.title')} id="move">
      <${JogControls} arm=${arm.data} joints_deg=${now?.joints_deg} send=${send} busy=${running.value ? t('move.running') : ''} />
      <${Outcome} last=${last} /></${Card}>
    <${Card} title=${t('move.stands')} id="stands"><${Missing} asked=${arm} /><${Stands} now=${now} limits_deg=${arm.data?.limits_deg} /></${Card}>
    <${Card} title=${t('cell.camera')} id="camera"><${LivePicture} /></${Card}>
    <${Card} title=${t('cell.scene')} id="scene" wide="3"><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
  </div>`;
}

/** What became of the last jog; while another run is in progress, which one that is. */
function Outcome({ last }) {
  const shown = useMove(last);
  if (running.value && run.value.id !== last) return html`<${Reasons} />`;
  if (!shown) return readyWith()?.calibrate?.ready === false ? html`<${Reasons} />` : null;
  return html`<${MoveOutcome} run=${shown} />`;
}

/** Where the arm stands: each axis within its limits, and the flange in the base. */
function Stands({ now, limits_deg }) {
  if (!now) return html`<p class="quiet">${t('robot.unknown')}</p>`;
  const { translation_mm, quaternion_wxyz } = now.base_T_flange;
  return html`<div class=${old.value ? 'dimmed' : ''}>
    <div class="axes-list">${now.joints_deg.map((angle, index) => html`<${AxisBar} axis=${index + 1} angle=${angle} limits=${limits_deg?.[index]} />`)}</div>
    ${!limits_deg && html`<p class="small quiet">${t('move.no-limits')}</p>`}
    <${Facts} rows=${[
      [t('move.at'), html`<span class="mono">${vector(translation_mm, 1)} mm</span>`],
      [t('pose.quaternion'), html`<span class="mono">${vector(quaternion_wxyz, 4)}</span>`],
    ]} /></div>`;
}

function AxisBar({ axis, angle, limits }) {
  const at = limits && Math.min(100, Math.max(0, (100 * (angle - limits[0])) / (limits[1] - limits[0])));
  const near = limits && Math.min(angle - limits[0], limits[1] - angle) < 10;
  const said = limits ? t('move.limits', { low: fixed(limits[0], 0), high: fixed(limits[1], 0) }) : '';
  return html`<div class="axis-bar"><span class="name">${axis}</span>
    ${limits ? html`<svg viewBox="0 0 100 20" preserveAspectRatio="none" role="img" aria-label=${said}><rect class="track" y="8" width="100" height="4" /><rect class="left" x=${at - 0.8} y="2" width="1.6" height="16" /></svg>` : html`<span></span>`}
    <span class="value">${fixed(angle, 1)}°${near ? html` <span class="small">! ${t('move.near-limit')}</span>` : ''}</span></div>`;
}
