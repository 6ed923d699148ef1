// By hand: what the camera sees and the frame where the target belongs, a button that is held to go there, the way axis by axis,
// a jog. "Take picture" is never refused for being elsewhere.
import { html, useMemo, useState } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Bar, Steps } from '../parts/bar.js';
import { Card } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { Chips } from '../parts/chips.js';
import { Film } from '../parts/film.js';
import { HeldMove } from '../parts/held_move.js';
import { JogControls } from '../parts/jog_controls.js';
import { useAsked } from '../parts/loaded.js';
import { LivePicture } from '../parts/live_picture.js';
import { carriedBy, placesOf } from '../parts/places.js';
import { stepsTo } from '../parts/pose.js';
import { picturesOf } from '../parts/run_times.js';
import { WayToGo, isNear } from '../parts/way_to_go.js';
import { ask, newKey } from '../state/ask.js';
import { cameraOf, ofCamera } from '../state/sensors.js';
import { fixed, inRow, mm, signed } from '../state/numbers.js';
import { may, note, old, robot } from '../state/now.js';
import { t } from '../state/words.js';

const HELD_SPEEDS_MM_S = [10, 25, 50]; // the daemon takes no faster one while a button is held
const MOVE_LIMIT_S = 600; // a jog is answered when the arm stands; all axes at the lowest speed take minutes

export function ByHand({ shown }) {
  const arm = useAsked(ofCamera('/arm', cameraOf(shown)));
  const inForce = useAsked(ofCamera('/calibrations/current', cameraOf(shown)), ['applied']);
  const views = useAsked(`/runs/${encodeURIComponent(shown.id)}/views`, ['run']);
  const speeds = HELD_SPEEDS_MM_S.filter((speed) => !arm.data || speed <= arm.data.speed_mm_s);
  const [asked, setAsked] = useState(HELD_SPEEDS_MM_S.at(-1));
  const speed_mm_s = speeds.includes(asked) ? asked : speeds.at(-1); // none where the settings allow less than all of them
  const { planning, station } = shown;
  const { number, of } = picturesOf(shown);
  const now = robot.value;
  const next = planning?.next_pose;
  const here = now?.base_T_flange;
  const places = placesOf(inForce.data?.calibration, here);
  const { carried, at } = carriedBy(inForce.data?.calibration, arm.data?.setup);
  const parts = useMemo(() => ({
    skeleton_mm: now?.skeleton_mm, flange_mm: here?.translation_mm, box_mm: arm.data?.box_mm, outline_mm: arm.data?.target_points_mm,
    target: places.target, carried, next: next ? at(next) : null, here: places.camera ?? here,
  }), [now, arm.data, inForce.data, next]);
  const [seen, setSeen] = useState(null);
  const near = here && next && isNear(here, next, planning.near) && seen?.corners?.length > 0;
  const [held, setHeld] = useState(null); // which of the buttons that move the arm is held
  const [stands, setStands] = useState(false); // after a jog from here
  const post = async (what, options) => {
    setStands(false);
    await ask(`/runs/${encodeURIComponent(shown.id)}/${what}`, { method: 'POST', ...options });
    note('run');
  };
  const act = (what) => () => post(what, { key: newKey(), limit_s: 60 });
  const jog = async (body, key) => {
    await post('jog', { key, body, limit_s: MOVE_LIMIT_S });
    setStands(true);
  };
  const waits = shown.state === 'waiting';
  const moving = shown.state === 'moving'; // of a run by hand: it jogs
  const jogs = arm.data?.moves ?? false; // a robot that is only read is jogged with the pendant
  const off = !may('operator') || old.value || !waits;
  const goes = jogs && here && next;
  const goesFirst = goes && (!near || held === 'there');
  const why = may('operator') ? t(waits ? 'move.running' : moving ? 'move.moving' : `state.${shown.state}`) : t('missing.role');
  return html`<div class="cockpit by-hand">
    <${Bar} steps=${html`<${Steps} at="pictures" run=${shown.id} />`}
      sentence=${html`<span id="advice">${t('jog.title', { view: number, of })}: ${waits || moving ? html`<${Advice} planning=${planning} here=${here} near=${near} goes=${goes} />` : t(`state.${shown.state}`)}</span>`}
      about=${`${t(jogs ? 'jog.nothing-moves' : 'jog.pendant-only')}${planning?.now_mm ? ` ${t('jog.so-far', { U: mm(planning.now_mm) })}` : ''}`} />
    <${Card} title=${t('cell.camera')} id="camera" flush><${LivePicture} of=${cameraOf(shown)} onSeen=${setSeen} belongs=${planning?.next_outline_px} />
      ${planning?.next_outline_px && html`<p class="belongs-here"><b aria-hidden="true"></b> ${t('way.belongs')}</p>`}</${Card}>
    <div class="side">
      ${goes && html`<div class="acts"><${HeldMove} id="hold-there" to=${next} speed_mm_s=${speed_mm_s} within=${shown.id} onHeld=${(now) => setHeld(now ? 'there' : null)} label=${t('way.go')} primary=${goesFirst} disabled=${off && held !== 'there'} why=${why} /></div>`}
      <div class="acts jog-acts">
        <${Act} label=${t('jog.take')} primary=${!goesFirst} disabled=${off} act=${act('stations')} />
        <${Act} label=${t('jog.finish')} disabled=${off || station < 3} act=${act('finish')} />
        ${station < 3 && html`<p class="small quiet">${t('jog.least')}</p>`}
      </div>
      <${Card} title=${t(goes ? 'way.by-axis' : 'way.title')} id="way">
        ${here && next ? html`<${WayToGo} here=${here} there=${next} near=${planning.near} hold=${goes && { within: shown.id, speed_mm_s, held, setHeld, off }} />` : html`<p class="quiet">${t('way.free')}</p>`}
        ${goes && speeds.length > 1 && html`<${Chips} label=${t('move.speed')} values=${speeds} chosen=${speed_mm_s} text=${(one) => `${fixed(one, 0)} mm/s`} choose=${setAsked} />`}
      </${Card}>
      ${jogs && html`<${Card} title=${t('move.title')} id="move">
        <${JogControls} arm=${arm.data} joints_deg=${now?.joints_deg} send=${jog} busy=${waits ? '' : t(moving ? 'move.moving' : `state.${shown.state}`)} />
        <p role="status">${moving ? html`<b>● ${t('move.moving')}</b>` : waits && stands && html`<b>✓ ${t('move.done')}</b>`}</p></${Card}>`}
    </div>
    <div class="below-picture">
      <${Card} title=${t('cell.scene')} id="scene" flush><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
      <${Film} shown=${shown} rows=${views.data?.views ?? []} />
    </div>
  </div>`;
}

/** What to do from where the arm stands now: the daemon's advice is of where it stood at the last view. */
function Advice({ planning, here, near, goes }) {
  if (near) return t('jog.near');
  if (goes && planning.next_outline_px) return t('jog.frame');
  const next = planning?.next_pose;
  const steps = here && next ? stepsTo(here, next) : (planning?.advice_steps ?? []);
  if (!steps.length) return html`<span lang="en">${planning?.advice || ''}</span>`;
  return steps.map((step) => ('deg' in step
    ? t('jog.turn', { deg: signed(Math.round(step.deg)), axis: step.turn_axis })
    : t('jog.shift', { mm: inRow(step.shift_mm.map((value) => signed(Math.round(value)))) }))).join(' ');
}
