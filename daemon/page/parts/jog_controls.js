// The controls of a jog: what moves, by which step, how fast; each move is held. The same on the Jog place and in a run by hand.
import { html, useState } from '../vendor/preact.js';
import { may } from '../state/now.js';
import { fixed, signed } from '../state/numbers.js';
import { t } from '../state/words.js';
import { Chips } from './chips.js';
import { HoldButton } from './hold_button.js';
import { MODES, SPEEDS_MM_S, STEPS_DEG, STEPS_MM, anglesOf, axesOf, axisName, requestOf, unitOf } from './jog_step.js';

const BEGIN = { mode: 'axis', axis: 1, frame: 'base', speed_mm_s: 25, step_deg: 5, step_mm: 10 };

/** `send(body, key)` asks for the jog; `busy` says why it cannot be asked for now, and is empty when it can. */
export function JogControls({ arm, joints_deg = [], send, busy = '' }) {
  const [how, setHow] = useState(BEGIN);
  const [typed, setTyped] = useState(null); // angles as they are typed; null: those at which the arm stands
  const texts = typed ?? joints_deg.map((angle) => angle.toFixed(1));
  const angles_deg = anglesOf(texts);
  const { mode } = how;
  const axes = axesOf(mode, joints_deg);
  const axis = axes.includes(how.axis) ? how.axis : 1;
  const speeds = SPEEDS_MM_S.filter((speed) => !arm || speed <= arm.speed_mm_s);
  const speed_mm_s = speeds.includes(how.speed_mm_s) ? how.speed_mm_s : (speeds.at(-1) ?? null);
  const readOnly = arm?.moves === false;
  const off = !may('operator') || Boolean(busy) || readOnly || (mode === 'angles' && !angles_deg);
  const why = !may('operator') ? t('missing.role') : busy || t(readOnly ? 'move.read-only' : 'move.no-angles');
  const act = (sign) => (key) => send(requestOf({ ...how, axis, angles_deg, speed_mm_s }, sign), key);
  const hold = (sign, label) => html`<${HoldButton} id=${`hold-${sign > 0 ? 'plus' : 'minus'}`} label=${label} act=${act(sign)} disabled=${off} why=${why} />`;
  const step = mode === 'shift' ? how.step_mm : how.step_deg;
  const name = mode === 'axis' ? t('move.axis', { axis }) : axisName(mode, axis);
  const change = (part) => setHow({ ...how, ...part });
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
    ${mode === 'angles' ? hold(1, t('move.to-angles')) : html`<div class="pair">${[-1, 1].map((sign) => hold(sign, `${name} ${withUnit(sign * step, mode, signed)}`))}</div>`}`;
}

const withUnit = (value, mode, text = (one) => fixed(one, 0)) => `${text(value)}${mode === 'shift' ? ' ' : ''}${unitOf(mode)}`;
