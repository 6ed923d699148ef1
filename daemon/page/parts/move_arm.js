// Moving the arm by steps: a drawer at the right, beside the picture of the camera; each step is held.
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { fixed, vector } from '../state/numbers.js';
import { note, old, robot, run, running } from '../state/now.js';
import { readyWith } from '../state/sensors.js';
import { t } from '../state/words.js';
import { Facts } from './card.js';
import { JogControls } from './jog_controls.js';
import { MoveOutcome, useMove } from './move_outcome.js';
import { Reasons } from './reasons.js';

/** The button that opens the drawer, and the drawer. `arm`: of GET /arm; `open`: at once; `primary`: the main thing to do. */
export function MoveArm({ arm, open: first = false, primary = false }) {
  const [open, setOpen] = useState(first);
  const [last, setLast] = useState(null); // the id of the jog that was begun here
  const button = useRef(null);
  const drawer = useRef(null);
  const send = async (body, key) => {
    const { data } = await ask('/robot/jog', { method: 'POST', key, body });
    setLast(data.id);
    note('run');
  };
  const close = () => {
    setOpen(false);
    button.current?.focus();
  };
  useEffect(() => {
    if (open) drawer.current?.focus();
  }, [open]);
  const onKey = (event) => open && event.key === 'Escape' && close(); // on the button, too: the drawer has the focus a moment later
  return html`<button type="button" class=${primary ? 'primary' : ''} ref=${button} aria-expanded=${open} aria-controls="move" onClick=${() => setOpen(!open)} onKeyDown=${onKey}>${t('place.jog')}</button>
    ${open && html`<aside class="drawer card" id="move" tabindex="-1" ref=${drawer} aria-labelledby="move-title" onKeyDown=${onKey}>
      <header><h2 id="move-title">${t('move.title')}</h2><button type="button" class="round" aria-label=${t('close')} onClick=${close}>✕</button></header>
      <${JogControls} arm=${arm} joints_deg=${robot.value?.joints_deg} send=${send} busy=${running.value ? t('move.running') : ''} />
      <${Outcome} last=${last} />
      <h3>${t('move.stands')}</h3>
      <${Stands} now=${robot.value} limits_deg=${arm?.limits_deg} />
    </aside>`}`;
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
