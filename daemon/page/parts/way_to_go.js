// Six bars "way to go" that empty into "near enough": three turns about the flange's axes, three shifts in the base.
import { html } from '../vendor/preact.js';
import { signed } from '../state/numbers.js';
import { t } from '../state/words.js';
import { wayToGo } from './pose.js';

const TURN_END_DEG = 90;
const SHIFT_END_MM = 600;

export function WayToGo({ here, there, near = { mm: 40, deg: 6 } }) {
  const { turns_deg, shifts_mm } = wayToGo(here, there);
  return html`<div class="way">
    <h3>${t('way.turn')}</h3>
    ${turns_deg.map((value, axis) => html`<${WayBar} name=${['Rx', 'Ry', 'Rz'][axis]} value=${value} end=${TURN_END_DEG} near=${near.deg} unit="°" />`)}
    <h3>${t('way.shift')}</h3>
    ${shifts_mm.map((value, axis) => html`<${WayBar} name=${['X', 'Y', 'Z'][axis]} value=${value} end=${SHIFT_END_MM} near=${near.mm} unit="mm" />`)}
    <p class="small quiet"><b class="key-near" aria-hidden="true"></b>${t('way.near')}</p>
  </div>`;
}

export function isNear(here, there, near = { mm: 40, deg: 6 }) {
  const { turns_deg, shifts_mm } = wayToGo(here, there);
  return Math.hypot(...turns_deg) <= near.deg && Math.hypot(...shifts_mm) <= near.mm;
}

function WayBar({ name, value, end, near, unit }) {
  const share = (length) => 100 * Math.min(1, Math.abs(length) / end);
  const done = Math.abs(value) <= near;
  return html`<div class="way-bar">
    <span class="name">${name}</span>
    <svg viewBox="-104 0 208 24" preserveAspectRatio="none" aria-hidden="true">
      <rect class="track" x="-104" y="10" width="208" height="4" />
      <rect class=${done ? 'left done' : 'left'} x=${value < 0 ? -share(value) : 0} y="7" width=${share(value)} height="10" />
      <rect class="near" x=${-share(near)} y="2" width=${2 * share(near)} height="20" />
    </svg>
    <span class="value">${done ? '✓ ' : ''}${signed(Math.round(value))} ${unit}</span>
  </div>`;
}
