// The arm brings the tip to the stand-off before a point, then nearer by steps; each move is held by itself.
import { html, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { may, note, robot, running } from '../state/now.js';
import { fixed } from '../state/numbers.js';
import { readyWith } from '../state/sensors.js';
import { t } from '../state/words.js';
import { Facts } from './card.js';
import { Chips } from './chips.js';
import { HoldButton } from './hold_button.js';
import { MoveOutcome, useMove } from './move_outcome.js';
import { STAND_OFF_MM, STEPS_MM, approachRequest, leftOf } from './touch_request.js';

const AT_POINT_MM = 0.01; // a step of less is refused

/** `moves`: whether the daemon moves the robot; the others as of `approachRequest`. Made anew for another point. */
export function Approach({ test, tip, verification, id, moves = true }) {
  const [last, setLast] = useState(null); // the id of the move that was begun here
  const [step_mm, setStep] = useState(2);
  const move = useMove(last);
  const left = running.value ? null : leftOf(move, robot.value);
  const act = (step) => async (key) => {
    const body = approachRequest({ test, tip, verification, id, step_mm: step });
    const { data } = await ask('/touch/approach', { method: 'POST', key, body });
    setLast(data.id);
    note('run');
  };
  const ready = readyWith()?.calibrate?.ready;
  const why = !may('operator') ? 'missing.role' : !moves ? 'move.read-only' : !tip ? 'touch.tip-first' : running.value ? 'move.running' : ready ? '' : 'touch.not-ready';
  const whyNot = why || (!left ? 'touch.stand-off-first' : left.left_mm < AT_POINT_MM ? 'touch.at-point' : '');
  const length = (value) => `${fixed(value, value % 1 ? 1 : 0)} mm`;
  return html`<h3>${t('touch.bring')}</h3>
    <p class="small quiet">${t('touch.bring.about')}</p>
    <${HoldButton} id="hold-stand-off" label=${t('touch.stand-off', { mm: length(STAND_OFF_MM), point: id })} act=${act(null)} disabled=${Boolean(why)} why=${why && t(why)} />
    <${Chips} label=${t('move.step')} values=${STEPS_MM} chosen=${step_mm} text=${length} choose=${setStep} />
    <${HoldButton} id="hold-nearer" label=${t('touch.nearer', { mm: length(step_mm), point: id })} act=${act(step_mm)} disabled=${Boolean(whyNot)} why=${whyNot && t(whyNot)} />
    ${move && html`<${MoveOutcome} run=${move} />`}
    ${left && html`<${Facts} rows=${[[t('touch.left'), html`<b>${fixed(left.left_mm, 2)} mm</b>`], [t('touch.beside'), `${fixed(left.beside_mm, 2)} mm`]]} />`}`;
}
