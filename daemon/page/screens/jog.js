// Jog: one small move of the arm at a time, by axis, along or about a frame, or of all axes to their angles; each held.
import { html, useMemo, useState } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { HoldButton } from '../parts/hold_button.js';
import { MODES, SPEEDS_MM_S, STEPS_DEG, STEPS_MM, anglesOf, axesOf, axisName, requestOf, unitOf } from '../parts/jog_step.js';
import { LivePicture } from '../parts/live_picture.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { placesOf } from '../parts/places.js';
import { Cause } from '../parts/problem.js';
import { Reasons } from '../parts/reasons.js';
import { ask } from '../state/ask.js';
import { may, note, old, ready, robot, run, running } from '../state/now.js';
import { fixed, signed, vector } from '../state/numbers.js';
import { t } from '../state/words.js';

const BEGIN = { mode: 'axis', axis: 1, frame: 'base', speed_mm_s: 25, step_deg: 5, step_mm: 10 };

export function Jog() {
  const arm = useAsked('/arm');
  const inForce = useAsked('/calibrations/current', ['applied']);
  const [how, setHow] = useState(BEGIN);
  const now = robot.value;
  const places = placesOf(inForce.data?.calibration, now?.base_T_flange);
  const parts = useMemo(() => ({
    skeleton_mm: now?.skeleton_mm, flange_mm: now?.base_T_flange?.translation_mm, box_mm: arm.data?.box_mm,
    outline_mm: arm.data?.target_points_mm, target: places.target, here: places.camera,
  }), [now, arm.data, inForce.data]);
  return html`<div class="grid jogging">
    <${Card} title=${t('move.title')} id="move"><${Move} how=${how} change=${(part) => setHow({ ...how, ...part })} arm=${arm.data} joints_deg=${now?.joints_deg} /></${Card}>
    <${Card} title=${t('move.stands')} id="stands"><${Missing} asked=${arm} /><${Stands} now=${now} limits_deg=${arm.data?.limits_deg} /></${Card}>
    <${Card} title=${t('cell.camera')} id="camera"><${LivePicture} /></${Card}>
    <${Card} title=${t('cell.scene')} id="scene" wide="3"><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
  </div>`;
}

function Move({ how, change, arm, joints_deg = [] }) {
  const [typed, setTyped] = useState(null); // angles as they are typed; null: those at which the arm stands
  const [last, setLast] = useState(null); // the id of the jog that was begun here
  const texts = typed ?? joints_deg.map((angle) => angle.toFixed(1));
  const angles_deg = anglesOf(texts);
  const { mode } = how;
  const axes = axesOf(mode, joints_deg);
  const axis = axes.includes(how.axis) ? how.axis : 1;
  const speeds = SPEEDS_MM_S.filter((speed) => !arm || speed <= arm.speed_mm_s);
  const speed_mm_s = speeds.includes(how.speed_mm_s) ? how.speed_mm_s : (speeds.at(-1) ?? null);
  const act = (sign) => async (key) => {
    const { data } = await ask('/robot/jog', { method: 'POST', key, body: requestOf({ ...how, axis, angles_deg, speed_mm_s }, sign) });
    setLast(data.id);
    note('run');
  };
  const off = !may('operator') || running.value || arm?.moves === false || (mode === 'angles' && !angles_deg);
  const why = t(!may('operator') ? 'missing.role' : running.value ? 'move.running' : arm?.moves === false ? 'move.read-only' : 'move.no-angles');
  const hold = (sign, label) => html`<${HoldButton} id=${`hold-${sign > 0 ? 'plus' : 'minus'}`} label=${label} act=${act(sign)} disabled=${off} why=${why} />`;
  const step = mode === 'shift' ? how.step_mm : how.step_deg;
  const name = mode === 'axis' ? t('move.axis', { axis }) : axisName(mode, axis);
  const set = (part) => {
    setTyped(null);
    change(part);
  };
  return html`
    <${Chips} label=${t('move.how')} values=${MODES} chosen=${mode} text=${(one) => t(`move.by.${one}`)} choose=${(one) => set({ mode: one, axis: 1 })} />
    ${mode !== 'angles' && html`
      ${mode !== 'axis' && html`<${Chips} label=${t('move.frame')} values=${['base', 'flange']} chosen=${how.frame} text=${(one) => t(`move.${one}`)} choose=${(frame) => set({ frame })} />`}
      <${Chips} label=${t('move.which')} values=${axes} chosen=${axis} text=${(one) => axisName(mode, one)} choose=${(one) => set({ axis: one })} />
      <${Chips} label=${t('move.step')} values=${mode === 'shift' ? STEPS_MM : STEPS_DEG} chosen=${step} text=${(one) => withUnit(one, mode)} choose=${(one) => set(mode === 'shift' ? { step_mm: one } : { step_deg: one })} />`}
    ${mode === 'angles' && html`<div class="angles">${texts.map((text, index) => html`<div key=${index}><label for=${`angle-${index}`}>${t('move.angle', { axis: index + 1 })}</label>
      <input id=${`angle-${index}`} inputmode="decimal" value=${text} autocomplete="off" onInput=${(event) => setTyped(texts.map((one, at) => (at === index ? event.target.value : one)))} /></div>`)}</div>`}
    <${Chips} label=${t('move.speed')} values=${speeds} chosen=${speed_mm_s} text=${(one) => `${fixed(one, 0)} mm/s`} choose=${(one) => change({ speed_mm_s: one })} />
    ${mode === 'angles' ? hold(1, t('move.to-angles')) : html`<div class="pair">${[-1, 1].map((sign) => hold(sign, `${name} ${withUnit(sign * step, mode, signed)}`))}</div>`}
    <${Outcome} last=${last} />`;
}

const withUnit = (value, mode, text = (one) => fixed(one, 0)) => `${text(value)}${mode === 'shift' ? ' ' : ''}${unitOf(mode)}`;

function Chips({ label, values, chosen, text, choose }) {
  return html`<div class="chips" role="group" aria-label=${label}><span class="small quiet" aria-hidden="true">${label}</span>
    <div class="row">${values.map((value) => html`<button type="button" class="chip" key=${value} aria-pressed=${value === chosen} onClick=${() => choose(value)}>${text(value)}</button>`)}</div></div>`;
}

/** What became of the last jog; while another run is in progress, which one that is. */
function Outcome({ last }) {
  const asked = useAsked(last && `/runs/${encodeURIComponent(last)}`, ['run'], { late: true });
  const shown = running.value && run.value.id === last ? run.value : asked.data;
  if (running.value && run.value.id !== last) return html`<${Reasons} />`;
  if (!shown) return ready.value?.calibrate?.ready === false ? html`<${Reasons} />` : null;
  const sign = { finished: '✓', failed: '✕', aborted: '■' }[shown.state] ?? '●';
  return html`<p role="status"><b>${sign} ${t(shown.state === 'finished' ? 'move.done' : shown.over ? `state.${shown.state}` : 'move.moving')}</b></p>
    ${shown.cause && html`<div class="note warn"><${Cause} cause=${shown.cause} /></div>`}`;
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
