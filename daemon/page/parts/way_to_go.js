// What is left to the next pose: three turns about the flange's axes, each as the one before left it, and three shifts in the base.
// Each has a bar that empties into "there", and arrows beside it: held, the arm turns or moves by what the bar shows.
import { html } from '../vendor/preact.js';
import { count, signed } from '../state/numbers.js';
import { t } from '../state/words.js';
import { useHeld } from './held_move.js';
import { alongAxis, wayInSteps, wayToGo } from './pose.js';
import { ProblemNote } from './problem.js';

const END = { turn: 90, shift: 600 }; // of a bar, degrees and mm
const AWAY = { turn: 10, shift: 50 }; // of an arrow that leads away
const UNITS = { turn: '°', shift: ' mm' };

/** `hold`: { within, speed_mm_s, held, setHeld, off } of the buttons; without it there are none: the robot is only read. */
export function WayToGo({ here, there, near = { mm: 40, deg: 6 }, hold }) {
  const { turns_deg, shifts_mm } = wayInSteps(here, there);
  const bars = [...turns_deg.map((value, axis) => ['turn', axis, value]), ...shifts_mm.map((value, axis) => ['shift', axis, value])];
  return html`<div class="way">
    ${bars.map(([kind, axis, value]) => html`<${hold ? HeldBar : Bar} key=${`${kind}-${axis}`} kind=${kind} axis=${axis} value=${value} near=${kind === 'turn' ? near.deg : near.mm} here=${here} hold=${hold} />`)}
    ${!hold && html`<p class="small quiet"><b class="key-near" aria-hidden="true"></b>${t('way.near')}</p>`}
  </div>`;
}

export function isNear(here, there, near = { mm: 40, deg: 6 }) {
  const { turns_deg, shifts_mm } = wayToGo(here, there);
  return Math.hypot(...turns_deg) <= near.deg && Math.hypot(...shifts_mm) <= near.mm;
}

function HeldBar({ kind, axis, value, near, here, hold }) {
  const name = t(`way.${kind}`, { axis: 'XYZ'[axis] });
  const done = Math.abs(value) <= near;
  const arrow = (sign) => {
    const towards = !done && Math.sign(value) === sign;
    const by = towards ? value : sign * AWAY[kind];
    const key = `${kind}-${axis}-${sign}`;
    const onHeld = (held) => hold.setHeld(held ? key : null);
    const one = useHeld({ to: alongAxis(here, kind, axis, by), speed_mm_s: hold.speed_mm_s, within: hold.within, onHeld, disabled: hold.off && hold.held !== key });
    const words = { name, value: t(`way.${kind}-by`, { value: count(Math.round(Math.abs(by))) }), side: t(sign < 0 ? 'way.minus' : 'way.plus') };
    const button = html`<button type="button" class="arrow ${towards ? 'towards' : ''} ${one.state}" aria-label=${t(towards ? 'way.towards' : 'way.away', words)} aria-disabled=${one.off ? 'true' : undefined} ...${one.listen}>
      <span class="fill" aria-hidden="true"></span><span class="label" aria-hidden="true">${sign < 0 ? '◀' : '▶'}</span></button>`;
    return { button, problem: one.problem };
  };
  const [minus, plus] = [arrow(-1), arrow(1)];
  const problem = minus.problem ?? plus.problem;
  return html`<${Bar} kind=${kind} axis=${axis} value=${value} near=${near} before=${minus.button} after=${plus.button} />
    ${problem && html`<${ProblemNote} problem=${problem} />`}`;
}

function Bar({ kind, axis, value, near, before, after }) {
  const share = (length) => 100 * Math.min(1, Math.abs(length) / END[kind]);
  const done = Math.abs(value) <= near;
  return html`<div class="way-bar ${before ? 'held' : ''}">
    <span class="name">${t(`way.${kind}`, { axis: 'XYZ'[axis] })} <small>${t(kind === 'turn' ? 'move.flange' : 'move.base')}</small></span>
    ${before}
    <svg viewBox="-104 0 208 24" preserveAspectRatio="none" aria-hidden="true">
      <rect class="track" x="-104" y="10" width="208" height="4" />
      <rect class=${done ? 'left done' : 'left'} x=${value < 0 ? -share(value) : 0} y="7" width=${share(value)} height="10" />
      <rect class="near" x=${-share(near)} y="2" width=${2 * share(near)} height="20" />
    </svg>
    ${after}
    <span class="value">${done ? '✓ ' : ''}${signed(Math.round(value))}${UNITS[kind]}</span>
  </div>`;
}
