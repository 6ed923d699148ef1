// Calibrate, one flow with one address a run: prepare, pictures, result. Here is what comes before anything moves.
import { html, useEffect, useMemo, useRef, useState } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Bar, Steps } from '../parts/bar.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { HoldButton } from '../parts/hold_button.js';
import { LivePicture } from '../parts/live_picture.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { MoveArm } from '../parts/move_arm.js';
import { carriedBy, placesOf } from '../parts/places.js';
import { Reasons } from '../parts/reasons.js';
import { Whole } from '../parts/whole.js';
import { ask, newKey } from '../state/ask.js';
import { fixed, mm } from '../state/numbers.js';
import { may, note, robot, run, running } from '../state/now.js';
import { camera, cameraNamed, ofCamera, readyWith } from '../state/sensors.js';
import { go } from '../state/place.js';
import { t } from '../state/words.js';
import { Result } from './result.js';
import { Run } from './run.js';

/** `argument`: the id of a run, which is followed to its result. */
export function Calibrate({ argument }) {
  const named = useAsked(argument && argument !== run.value?.id ? `/runs/${encodeURIComponent(argument)}` : null, ['run']);
  const live = argument === run.value?.id;
  const shown = live ? run.value : named.data;
  const result = shown?.over ? shown.result?.calibration_id : null;
  const followed = useRef(null); // the run as it was last in progress: it stays as it is until its result is there whole
  if (followed.current?.id !== argument) followed.current = null;
  if (shown && !shown.over && (live || !followed.current)) followed.current = shown; // what was asked once may be old
  const awaits = !shown?.over || (shown.kind === 'calibration' && shown.state === 'finished');
  const [whole, setWhole] = useState(null); // id of the result that is there whole
  useEffect(() => {
    if (result) document.querySelector('h1')?.focus({ preventScroll: true });
  }, [result]);
  if (!argument) return html`<${Prepare} />`;
  return html`<div class="stacked">
    ${(!result || (followed.current && whole !== result)) && html`<${Run} key="run" argument=${argument} as=${awaits && followed.current} />`}
    ${result && html`<${Whole} key=${result} quiet=${followed.current} onWhole=${() => setWhole(result)}><${Result} argument=${result} /></${Whole}>`}
  </div>`;
}

function Prepare() {
  const [how, setHow] = useState({ way: 'daemon', until: 'settings', count: 6, tolerance_mm: 0.3, arm: null });
  const arm = useAsked(ofCamera('/arm'));
  const status = useAsked(ofCamera('/calibrate'), ['run', 'applied']);
  const [plan, setPlan] = useState(null);
  const change = (part) => {
    setHow({ ...how, ...part });
    setPlan(null);
  };
  const body = { ...requestOf(how), ...cameraNamed(camera.value) };
  const off = !may('operator') || running.value || !readyWith()?.calibrate?.ready;
  const begin = async (key) => {
    const { data } = await ask('/calibrate', { method: 'POST', body, key });
    note('run');
    go('calibrate', data.id);
  };
  const manual = how.way === 'manual';
  return html`<div class="cockpit prepare">
    <${Bar} steps=${html`<${Steps} at="prepare" />`} about=${html`<${Reasons} /><${Missing} asked=${status} />`}>
      <${MoveArm} arm=${arm.data} />
      ${manual
        ? html`<${Act} label=${t('calibrate.manual')} primary disabled=${off} act=${() => begin(newKey())} />`
        : html`<${HoldButton} id="hold-calibrate" primary label=${t('calibrate.start')} act=${begin} disabled=${off} why=${t(may('operator') ? 'calibrate.not-yet' : 'missing.role')} />`}
    </${Bar}>
    <${Card} title=${t('cell.camera')} id="camera" flush><${LivePicture} /></${Card}>
    <${WhatMoves} body=${body} arm=${arm.data} plan=${plan} />
    <${Card} title=${t('calibrate.3')} id="moves"><${Before} how=${how} body=${body} arm=${arm.data} status=${status.data} plan=${plan} setPlan=${setPlan} /></${Card}>
    <${Card} title=${t('calibrate.2')} id="how"><${How} how=${how} change=${change} taught=${arm.data?.taught_poses?.length ?? 0} model=${arm.data?.model} armByDefault=${arm.data?.identifies_arm ?? false} /></${Card}>
  </div>`;
}

/** The body of POST /calibrate and POST /plan for what was chosen; what is not chosen is as the settings say. */
export function requestOf({ way, until, count, tolerance_mm, arm }) {
  const wanted = { count: { count }, tolerance: { tolerance_mm }, settings: {} }[until];
  return { ...wanted, ...(way === 'manual' ? { manual: true } : {}), ...(arm === null ? {} : { arm }) };
}

function How({ how, change, taught, model, armByDefault }) {
  const arm = how.arm ?? armByDefault;
  const radio = (name, value, label, about) => html`<label class="radio"><input type="radio" name=${name} value=${value} checked=${how[name] === value} onChange=${() => change({ [name]: value })} /><span><b>${label}</b>${about && html`<br /><span class="small quiet">${about}</span>`}</span></label>`;
  return html`<fieldset><legend>${t('how.way')}</legend>
      ${taught > 0 ? radio('way', 'daemon', t('how.taught'), t('how.taught-about', { count: taught })) : radio('way', 'daemon', t('how.planned'), t('how.planned-about'))}
      ${radio('way', 'manual', t('how.manual'), t('how.manual-about'))}
    </fieldset>
    <fieldset><legend>${t('how.until')}</legend>
      ${radio('until', 'settings', t('how.settings'))}
      ${radio('until', 'count', t('how.count'))}
      ${how.until === 'count' && html`<${Stepper} value=${how.count} low=${3} high=${30} step=${1} label=${t('how.count')} text=${fixed(how.count, 0)} set=${(value) => change({ count: value })} />`}
      ${radio('until', 'tolerance', t('how.tolerance'))}
      ${how.until === 'tolerance' && html`<${Stepper} value=${how.tolerance_mm} low=${0.05} high=${5} step=${0.05} label=${t('how.tolerance')} text=${`± ${mm(how.tolerance_mm)}`} set=${(value) => change({ tolerance_mm: value })} />`}
    </fieldset>
    <fieldset><legend>${t('how.arm')}</legend>
      <label class="check"><input type="checkbox" checked=${arm} disabled=${!model} onChange=${() => change({ arm: !arm })} /><span><b>${t('how.arm-errors')}</b><br /><span class="small quiet">${model ? t('how.arm-about', { model }) : t('how.arm-unknown')}</span></span></label>
    </fieldset>`;
}

function Stepper({ value, low, high, step, label, text, set }) {
  const to = (next) => set(Math.min(high, Math.max(low, Number(next.toFixed(4)))));
  return html`<div class="stepper" role="group" aria-label=${label}>
    <button type="button" onClick=${() => to(value - step)} aria-label=${t('less')}>−</button><output>${text}</output>
    <button type="button" onClick=${() => to(value + step)} aria-label=${t('more')}>+</button></div>`;
}

function WhatMoves({ arm, plan }) {
  const active = useAsked(ofCamera('/calibrations/current'), ['applied']);
  const now = robot.value;
  const places = placesOf(active.data?.calibration, now?.base_T_flange);
  const parts = useMemo(() => {
    const { carried, at } = carriedBy(active.data?.calibration, arm?.setup);
    return {
      skeleton_mm: now?.skeleton_mm, flange_mm: now?.base_T_flange?.translation_mm, box_mm: arm?.box_mm, outline_mm: arm?.target_points_mm,
      target: places.target, here: active.data?.calibration?.base_T_camera, carried, planned: (plan?.poses ?? []).map(({ base_T_flange }) => at(base_T_flange)),
    };
  }, [now, arm, plan, active.data]);
  return html`<${Card} title=${arm?.model || t('cell.scene')} id="scene" flush><${CellScene} parts=${parts} /></${Card}>`;
}

/** What a person knows before the arm moves: who may be where, how fast, how many pictures, the accuracy to expect. */
function Before({ how, body, arm, status, plan, setPlan }) {
  const look = async () => setPlan((await ask('/plan', { method: 'POST', body, limit_s: 60 })).data);
  const last = plan?.predicted_mm?.at(-1);
  const manual = how.way === 'manual';
  return html`<p>${t(manual ? 'calibrate.manual-start' : 'calibrate.moves')}</p>
    <${Facts} rows=${[
      [t('moves.speed'), arm ? `${fixed(arm.speed_mm_s, 0)} mm/s` : '—'],
      plan && [t('moves.poses'), fixed(plan.poses.length, 0)],
      last !== undefined && last !== null && [t('moves.expect'), `± ${mm(last)}`],
    ]} />
    ${!manual && html`<p class="quiet">${t('moves.first')}</p>`}
    ${!manual && may('operator') && html`<${Act} label=${t('moves.plan')} act=${look} />`}
    <p class="quiet">${status ? t(`policy.${status.policy}`) : '\u00a0'}</p>`; // its place is kept until it is known
}
