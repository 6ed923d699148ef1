// A run: its sentence, steps and times, the newest picture, the arm, what is known and expected, all pictures in a row.
import { html, useMemo, useRef, useState } from '../vendor/preact.js';
import { Bar, Steps } from '../parts/bar.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { UncertaintyCurve } from '../parts/chart.js';
import { Film, frameOf } from '../parts/film.js';
import { Uncertainty } from '../parts/in_force.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { Picture } from '../parts/picture.js';
import { carriedBy, placesOf } from '../parts/places.js';
import { Cause } from '../parts/problem.js';
import { picturesOf, timesOf } from '../parts/run_times.js';
import { ViewTable } from '../parts/view_table.js';
import { fixed, mm, moment, timeOfDay } from '../state/numbers.js';
import { clock, old, robot, run } from '../state/now.js';
import { cameraOf, ofCamera } from '../state/sensors.js';
import { linkTo } from '../state/place.js';
import { sentence, t } from '../state/words.js';
import { ByHand } from './by_hand.js';

/** `as`: what is shown of the run instead of how it is now. */
export function Run({ argument, as }) {
  const named = useAsked(argument && argument !== run.value?.id ? `/runs/${encodeURIComponent(argument)}` : null, ['run']);
  const newest = useAsked(!argument && !run.value ? '/runs?limit=1' : null, ['run']);
  const shown = as || (argument && argument !== run.value?.id ? named.data : (run.value ?? newest.data?.runs[0]));
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
  const sees = !['scan', 'jog'].includes(shown.kind);
  const views = useAsked(sees ? `/runs/${encodeURIComponent(shown.id)}/views` : null, ['run']);
  const active = useAsked(ofCamera('/calibrations/current', cameraOf(shown)), ['applied']);
  const rows = views.data?.views ?? [];
  const view = rows.find(({ index }) => index === chosen) ?? rows.at(-1);
  const { planning } = shown;
  const calibrates = shown.kind === 'calibration';
  const now = robot.value;
  const places = placesOf(active.data?.calibration, now?.base_T_flange);
  const parts = useMemo(() => {
    const { carried, at } = carriedBy(active.data?.calibration, arm.data?.setup);
    const ahead = shown.over ? [] : (planning?.planned_poses ?? []);
    return {
      skeleton_mm: now?.skeleton_mm, flange_mm: now?.base_T_flange?.translation_mm, box_mm: arm.data?.box_mm,
      outline_mm: views.data?.target_outline_mm ?? arm.data?.target_points_mm, target: places.target, here: active.data?.calibration?.base_T_camera,
      carried, views: rows.map(({ base_T_flange }) => at(base_T_flange)),
      next: ahead.length ? at(ahead[0].base_T_flange) : null, planned: ahead.slice(1).map(({ base_T_flange }) => at(base_T_flange)),
    };
  }, [now, arm.data, views.data, active.data, shown]);
  const result = shown.result?.calibration_id;
  const size = view?.size ?? undefined;
  return html`<div class="cockpit run">
    <${Bar} steps=${calibrates && html`<${Steps} at="pictures" run=${shown.id} result=${result} />`} mark=${SIGNS[shown.state]}
      sentence=${sentenceOf(shown)} about=${html`<${StepBar} shown=${shown} /><${Times} shown=${shown} />`}>
      ${result && html`<a class="button primary" href=${linkTo('result', result)}>${t('place.result')}</a>`}
      ${shown.kind === 'verify' && shown.over && html`<a class="button primary" href=${linkTo('verify')}>${t('place.verify')}</a>`}
      ${shown.result?.scan_id && html`<a class="button primary" href=${linkTo('scans', shown.result.scan_id)}>${t('place.scans')}</a>`}
    </${Bar}>
    ${sees && html`<${Card} title=${view ? t('view.title', { view: view.index }) : t('cell.camera')} id="picture" flush>
      <${Picture} src=${view && frameOf(shown, view, 960)} size=${size} corners=${view?.corners ?? []}
        alt=${view ? t('view.alt', { view: view.index, count: view.corners?.length ?? 0 }) : t('view.none')} />
      ${calibrates && rows.length > 0 && html`<${Coverage} rows=${rows} size=${size} />`}
    </${Card}>`}
    <${Card} title=${t('cell.scene')} id="scene" flush><${CellScene} parts=${parts} dim=${old.value} /></${Card}>
    <${Card} title=${t(calibrates ? 'curve.title' : `kind.${shown.kind}`)} id="known"><${Known} shown=${shown} /></${Card}>
    ${sees && html`<${Film} shown=${shown} rows=${rows} chosen=${view?.index} choose=${setChosen} />`}
    ${sees && html`<${Card} title=${t('views.title')} id="views" low><${Missing} asked=${views} none=${t('view.none')} />
      ${views.data && html`<${ViewTable} rows=${rows} chosen=${view?.index} choose=${setChosen} />`}</${Card}>`}
  </div>`;
}

const SIGNS = { finished: '✓', failed: '✕', aborted: '■' };

export function sentenceOf(shown) {
  const { kind, state, stations, over } = shown;
  if (over) return `${t(`kind.${kind}`)}: ${t(`state.${state}`)}`;
  const { number, of } = picturesOf(shown);
  return stations ? `${t('run.view', { view: number, of })}: ${t(`state.${state}`)}` : t(`state.${state}`);
}

/** What is known so far and expected at the end, or what came of it; why it ended, who began it. */
function Known({ shown }) {
  const { planning, cause, over, request } = shown;
  const found = shown.result?.expanded_mm ? shown.result : null;
  const waits = shown.result?.not_applied && sentence(shown.result.not_applied);
  const history = planning?.history ?? [];
  const expected = history.findLast(({ planned_mm }) => planned_mm !== null)?.planned_mm;
  return html`
    ${found && html`<${Uncertainty} accuracy=${found} />`}
    ${!found && !over && planning && html`<div class="two-figures"><div><p class="quiet">${t('curve.told')}</p><p class="figure">${planning.now_mm ? `± ${mm(planning.now_mm)}` : '—'}</p></div>
      <div><p class="quiet">${t('curve.next')}</p><p class="figure expected">${expected ? `± ${mm(expected)}` : '—'}</p></div></div>`}
    ${waits && html`<p class="note warn" lang=${waits.lang}><span class="mark" aria-hidden="true">!</span> ${waits.text}</p>`}
    ${cause && html`<div class="note warn"><${Cause} cause=${cause} />
      <p class="small"><a href=${linkTo('help', cause.code)}>${cause.code}</a></p></div>`}
    ${!found && !cause && shown.kind === 'calibration' && html`<${UncertaintyCurve} history=${history} goal_mm=${planning?.goal?.tolerance_mm ?? request?.tolerance_mm} stations=${shown.stations} />`}
    ${over && html`<${Facts} rows=${[shown.started_by && [t('run.started-by'), shown.started_by], [t('run.since'), moment(shown.created_at)], [t('run.ended'), moment(shown.updated_at)]]} />`}`;
}

const [COLUMNS, ROWS] = [12, 8];

/** Which parts of the picture had corners of the target so far. */
function Coverage({ rows, size: [width, height] = [1920, 1200] }) {
  const seen = new Set(rows.flatMap(({ corners }) => (corners ?? []).map(([, u, v]) => Math.floor((u / width) * COLUMNS) + COLUMNS * Math.floor((v / height) * ROWS))));
  const share = fixed((100 * seen.size) / (COLUMNS * ROWS), 0);
  return html`<figure class="coverage"><svg viewBox="0 0 ${COLUMNS} ${ROWS}" aria-hidden="true">${[...seen].map((at) => html`<rect x=${at % COLUMNS} y=${Math.floor(at / COLUMNS)} width="0.9" height="0.9" />`)}</svg>
    <figcaption>${t('coverage', { share })}</figcaption></figure>`;
}

/** Time since the run began, from its first second on, and the time left by the pace of its pictures, from the second on. */
function Times({ shown }) {
  const heard = useRef({ key: '', at: 0 });
  const key = `${shown.id} ${shown.updated_at}`;
  if (heard.current.key !== key) heard.current = { key, at: clock.value };
  const { elapsed_s, left_s } = timesOf(shown, Math.max(0, clock.value - heard.current.at) / 1000);
  const begun = t('run.begun', { name: shown.started_by ?? '—', at: timeOfDay(shown.created_at) });
  if (shown.over) return html`<p class="small times">${begun}</p>`; // its line stays, so that nothing below it moves
  const left = left_s !== null && html`<b>${t('run.left', { s: fixed(left_s, 0) })}</b> · `;
  return html`<p class="small times">${left}${t('run.so-far', { s: fixed(elapsed_s, 0) })} · ${begun}</p>`;
}

function StepBar({ shown }) {
  const { state, stations, over } = shown;
  if (!stations) return null;
  const { taken, of } = picturesOf(shown);
  const done = over && state === 'finished' ? of : taken;
  return html`<div class="step-bar" role="img" aria-label=${t('run.steps', { done: Math.min(done, of), of })}>
    ${Array.from({ length: Math.min(of, 40) }, (_, index) => html`<span class=${index < done ? 'done' : index === done && !over ? 'doing' : ''}></span>`)}</div>`;
}
