// By hand: the advice large, what the camera sees, the way to go; "Take view" is never refused for being elsewhere.
import { html, useMemo } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Card } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { useAsked } from '../parts/loaded.js';
import { LivePicture } from '../parts/live_picture.js';
import { carriedBy, placesOf } from '../parts/places.js';
import { WayToGo, isNear } from '../parts/way_to_go.js';
import { ask, newKey } from '../state/ask.js';
import { inRow, mm, signed } from '../state/numbers.js';
import { look, may, note, old, robot } from '../state/now.js';
import { t } from '../state/words.js';

export function ByHand({ shown }) {
  const arm = useAsked('/arm');
  const inForce = useAsked('/calibrations/current', ['applied']);
  const { planning, station, stations } = shown;
  const now = robot.value;
  const next = planning?.next_pose;
  const here = now?.base_T_flange;
  const places = placesOf(inForce.data?.calibration, here);
  const { carried, at } = carriedBy(inForce.data?.calibration, arm.data?.setup);
  const parts = useMemo(() => ({
    skeleton_mm: now?.skeleton_mm, flange_mm: here?.translation_mm, box_mm: arm.data?.box_mm, outline_mm: arm.data?.target_points_mm,
    target: places.target, carried, next: next ? at(next) : null, here: places.camera ?? here,
  }), [now, arm.data, inForce.data, next]);
  const near = here && next && isNear(here, next, planning.near) && look.value?.corners?.length > 0;
  const act = (what) => async () => {
    await ask(`/runs/${encodeURIComponent(shown.id)}/${what}`, { method: 'POST', key: newKey(), limit_s: 60 });
    note('run');
  };
  const waits = shown.state === 'waiting';
  const off = !may('operator') || old.value || !waits;
  return html`<div class="grid">
    <${Card} title=${t('jog.title', { view: Math.min(station + 1, stations), of: stations })} id="advice" wide="3">
      <p class="sentence" role="status">${waits ? html`<${Advice} planning=${planning} />` : t(`state.${shown.state}`)}</p>
      <p class="quiet">${t('jog.nothing-moves')}${planning?.now_mm ? ` ${t('jog.so-far', { U: mm(2 * planning.now_mm) })}` : ''}</p>
      ${planning?.note && html`<p class="note warn" role="alert" lang="en"><span class="mark" aria-hidden="true">!</span> ${planning.note}</p>`}
    </${Card}>
    <${Card} title=${t('cell.camera')} id="camera"><${LivePicture} /></${Card}>
    <${Card} title=${t('way.title')} id="way">
      ${here && next ? html`<${WayToGo} here=${here} there=${next} near=${planning.near} />` : html`<p class="quiet">${t('way.free')}</p>`}
      <div class="row jog-acts">
        <${Act} label=${t('jog.take')} primary=${near || !next} disabled=${off} act=${act('stations')} />
        <${Act} label=${t('jog.finish')} disabled=${off || station < 3} act=${act('finish')} />
      </div>
      ${station < 3 && html`<p class="small quiet">${t('jog.least')}</p>`}
    </${Card}>
    <${Card} title=${t('cell.scene')} id="scene"><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
  </div>`;
}

function Advice({ planning }) {
  const steps = planning?.advice_steps ?? [];
  if (!steps.length) return html`<span lang="en">${planning?.advice || ''}</span>`;
  return steps.map((step) => ('deg' in step
    ? t('jog.turn', { deg: signed(Math.round(step.deg)), axis: step.turn_axis })
    : t('jog.shift', { mm: inRow(step.shift_mm.map((value) => signed(Math.round(value)))) }))).join(' ');
}
