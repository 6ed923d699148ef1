// Calibrate: ready? how, what will move, hold to start. Four steps on one page.
import { html, useMemo, useState } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { HoldButton } from '../parts/hold_button.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { carriedBy, placesOf } from '../parts/places.js';
import { Reasons } from '../parts/reasons.js';
import { ask, newKey } from '../state/ask.js';
import { fixed, mm } from '../state/numbers.js';
import { may, note, robot, running } from '../state/now.js';
import { camera, cameraNamed, ofCamera, readyWith } from '../state/sensors.js';
import { go } from '../state/place.js';
import { t } from '../state/words.js';

export function Calibrate() {
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
    await ask('/calibrate', { method: 'POST', body, key });
    note('run');
    go('run');
  };
  return html`<div class="grid steps">
    <${Card} title=${t('calibrate.1')} id="step-1"><${Reasons} /><${Missing} asked=${status} />
      ${status.data && html`<p class="quiet">${t(`policy.${status.data.policy}`)}</p>`}</${Card}>
    <${Card} title=${t('calibrate.2')} id="step-2"><${How} how=${how} change=${change} taught=${arm.data?.taught_poses?.length ?? 0} model=${arm.data?.model} armByDefault=${arm.data?.identifies_arm ?? false} /></${Card}>
    <${Card} title=${t('calibrate.3')} id="step-3" wide="2"><${WhatMoves} how=${how} body=${body} arm=${arm.data} plan=${plan} setPlan=${setPlan} /></${Card}>
    <${Card} title=${t('calibrate.4')} id="step-4">
      ${how.way === 'manual'
        ? html`<p>${t('calibrate.manual-start')}</p><${Act} label=${t('calibrate.manual')} primary disabled=${off} act=${() => begin(newKey())} />`
        : html`<p>${t('calibrate.moves')}</p><${HoldButton} id="hold-calibrate" label=${t('calibrate.start')} act=${begin} disabled=${off} why=${t(may('operator') ? 'calibrate.not-yet' : 'missing.role')} />`}
    </${Card}>
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

function WhatMoves({ how, body, arm, plan, setPlan }) {
  const inForce = useAsked(ofCamera('/calibrations/current'), ['applied']);
  const now = robot.value;
  const places = placesOf(inForce.data?.calibration, now?.base_T_flange);
  const parts = useMemo(() => {
    const { carried, at } = carriedBy(inForce.data?.calibration, arm?.setup);
    return {
      skeleton_mm: now?.skeleton_mm, flange_mm: now?.base_T_flange?.translation_mm, box_mm: arm?.box_mm, outline_mm: arm?.target_points_mm,
      target: places.target, here: inForce.data?.calibration?.base_T_camera, carried, planned: (plan?.poses ?? []).map(({ base_T_flange }) => at(base_T_flange)),
    };
  }, [now, arm, plan, inForce.data]);
  const look = async () => setPlan((await ask('/plan', { method: 'POST', body, limit_s: 60 })).data);
  const last = plan?.predicted_mm?.at(-1);
  return html`<${CellScene} parts=${parts} />
    <${Facts} rows=${[
      arm && [t('moves.speed'), `${fixed(arm.speed_mm_s, 0)} mm/s`],
      plan && [t('moves.poses'), fixed(plan.poses.length, 0)],
      last !== undefined && last !== null && [t('moves.expect'), `± ${mm(last)}`],
    ]} />
    ${how.way === 'manual' ? html`<p class="quiet">${t('moves.manual')}</p>`
      : html`<p class="quiet">${t('moves.first')}</p>${may('operator') && html`<${Act} label=${t('moves.plan')} act=${look} />`}`}`;
}
