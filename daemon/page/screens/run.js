// A run: its sentence, its steps, what the views tell and the next will, the cell, the last picture, the views.
import { html, useMemo, useState } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { UncertaintyCurve } from '../parts/chart.js';
import { Uncertainty } from '../parts/in_force.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { Picture } from '../parts/picture.js';
import { carriedBy, placesOf } from '../parts/places.js';
import { Cause } from '../parts/problem.js';
import { ViewTable } from '../parts/view_table.js';
import { mm, moment } from '../state/numbers.js';
import { old, robot, run } from '../state/now.js';
import { cameraOf, ofCamera } from '../state/sensors.js';
import { linkTo } from '../state/place.js';
import { sentence, t } from '../state/words.js';
import { ByHand } from './by_hand.js';

export function Run({ argument }) {
  const named = useAsked(argument && argument !== run.value?.id ? `/runs/${encodeURIComponent(argument)}` : null, ['run']);
  const newest = useAsked(!argument && !run.value ? '/runs?limit=1' : null, ['run']);
  const shown = argument && argument !== run.value?.id ? named.data : (run.value ?? newest.data?.runs[0]);
  if (!shown) {
    if (newest.data) return html`<${Card} title=${t('place.run')} id="no-run"><p>${t('run.never')}</p><p><a class="button primary" href=${linkTo('calibrate')}>${t('place.calibrate')}</a></p></${Card}>`;
    return html`<${Missing} asked=${argument ? named : newest} none=${t('run.unknown')} />`;
  }
  if (shown.request?.manual && !shown.over) return html`<${ByHand} shown=${shown} />`;
  return html`<${RunShown} shown=${shown} />`;
}

function RunShown({ shown }) {
  const [chosen, setChosen] = useState(null);
  const arm = useAsked(ofCamera('/arm', cameraOf(shown)));
  const views = useAsked(['scan', 'jog'].includes(shown.kind) ? null : `/runs/${encodeURIComponent(shown.id)}/views`, ['run']);
  const inForce = useAsked(ofCamera('/calibrations/current', cameraOf(shown)), ['applied']);
  const rows = views.data?.views ?? [];
  const view = rows.find(({ index }) => index === chosen) ?? rows.at(-1);
  const planning = shown.planning;
  const now = robot.value;
  const places = placesOf(inForce.data?.calibration, now?.base_T_flange);
  const parts = useMemo(() => {
    const { carried, at } = carriedBy(inForce.data?.calibration, arm.data?.setup);
    const ahead = shown.over ? [] : (planning?.planned_poses ?? []);
    return {
      skeleton_mm: now?.skeleton_mm, flange_mm: now?.base_T_flange?.translation_mm, box_mm: arm.data?.box_mm,
      outline_mm: views.data?.target_outline_mm ?? arm.data?.target_points_mm, target: places.target, here: inForce.data?.calibration?.base_T_camera,
      carried, views: rows.map(({ base_T_flange }) => at(base_T_flange)),
      next: ahead.length ? at(ahead[0].base_T_flange) : null, planned: ahead.slice(1).map(({ base_T_flange }) => at(base_T_flange)),
    };
  }, [now, arm.data, views.data, inForce.data, shown]);
  return html`<div class="grid">
    <${Card} title=${t(`kind.${shown.kind}`)} id="sentence"><${Sentence} shown=${shown} /></${Card}>
    <${Card} title=${t('cell.scene')} id="scene" wide="2"><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
    ${shown.kind === 'calibration' && html`<${Card} title=${t('curve.title')} id="curve" wide="half">
      <${UncertaintyCurve} history=${planning?.history ?? []} goal_mm=${planning?.goal?.tolerance_mm ?? shown.request?.tolerance_mm} stations=${shown.stations} /></${Card}>`}
    ${!['scan', 'jog'].includes(shown.kind) && html`<${Card} title=${view ? t('view.title', { view: view.index }) : t('cell.camera')} id="picture" wide="half">
      <${Picture} src=${view && `/runs/${encodeURIComponent(shown.id)}/frames/${view.index}?width=960`} size=${view?.size ?? undefined} corners=${view?.corners ?? []}
        alt=${view ? t('view.alt', { view: view.index, count: view.corners?.length ?? 0 }) : t('view.none')} />
    </${Card}>
    <${Card} title=${t('views.title')} id="views" wide=${shown.kind === 'calibration' ? '3' : 'half'}><${Missing} asked=${views} none=${t('view.none')} />
      ${views.data && html`<${ViewTable} rows=${rows} chosen=${view?.index} choose=${setChosen} />`}</${Card}>`}
  </div>`;
}

export function Sentence({ shown }) {
  const { state, station, stations, planning, cause, over } = shown;
  const sign = { finished: '✓', failed: '✕', aborted: '■' }[state] ?? '';
  const found = shown.result?.expanded_mm ? shown.result : null;
  const waits = shown.result?.not_applied && sentence(shown.result.not_applied);
  const U = !found && planning?.now_mm ? `± ${mm(planning.now_mm)}` : null;
  return html`
    <p class="sentence" role="status">${sign} ${t(`state.${state}`)}${!over && stations ? `, ${t('run.view', { view: Math.min(station + 1, stations), of: stations })}` : ''}</p>
    <${StepBar} station=${over && state === 'finished' ? stations : station} stations=${stations} over=${over} />
    ${U && html`<p class="figure">${U}</p><p class="quiet">${t('U.predicted')}</p>`}
    ${found && html`<${Uncertainty} accuracy=${found} />`}
    ${waits && html`<p class="note warn" lang=${waits.lang}><span class="mark" aria-hidden="true">!</span> ${waits.text}</p>`}
    ${cause && html`<div class="note warn"><${Cause} cause=${cause} />
      <p class="small"><a href=${linkTo('help', cause.code)}>${cause.code}</a></p></div>`}
    <${Facts} rows=${[
      shown.started_by && [t('run.started-by'), shown.started_by], [t('run.since'), moment(shown.created_at)],
      over && [t('run.ended'), moment(shown.updated_at)],
    ]} />
    ${shown.result?.calibration_id && html`<p><a class="button primary" href=${linkTo('result', shown.result.calibration_id)}>${t('place.result')}</a></p>`}
    ${shown.kind === 'verify' && over && html`<p><a class="button" href=${linkTo('verify')}>${t('place.verify')}</a></p>`}
    ${shown.result?.scan_id && html`<p><a class="button" href=${linkTo('scans', shown.result.scan_id)}>${t('place.scans')}</a></p>`}`;
}

function StepBar({ station, stations, over }) {
  if (!stations) return null;
  return html`<div class="step-bar" role="img" aria-label=${t('run.steps', { done: Math.min(station, stations), of: stations })}>
    ${Array.from({ length: Math.min(stations, 40) }, (_, index) => html`<span class=${index < station ? 'done' : index === station && !over ? 'doing' : ''}></span>`)}</div>`;
}
