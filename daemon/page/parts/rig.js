// A rig: several cameras and scanners on one mount with one solution, by name; the newest one stored is active.
import { html, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { may, note } from '../state/now.js';
import { fixed, inRow, mm, moment, vector } from '../state/numbers.js';
import { has, t } from '../state/words.js';
import { Card, Facts } from './card.js';
import { Findings } from './findings.js';
import { HoldButton } from './hold_button.js';
import { Missing, useAsked } from './loaded.js';

const SHOWN = 20;

export function Rigs() {
  const rigs = useAsked(`/rigs?limit=${SHOWN}`, ['rig']);
  const [current, ...earlier] = rigs.data?.rigs ?? [];
  const [file, setFile] = useState(null); // { name, rig } of a rig.json that was chosen, or { name, wrong: true }
  const choose = async (event) => {
    const [chosen] = event.target.files;
    if (!chosen) return;
    try {
      const rig = JSON.parse(await chosen.text());
      setFile({ name: chosen.name, rig: Array.isArray(rig.sensors) && rig.verdict ? rig : null });
    } catch {
      setFile({ name: chosen.name, rig: null });
    }
  };
  const done = () => {
    setFile(null);
    note('rig');
  };
  return html`<${Card} title=${t('rig.title')} id="rig" wide="3"><${Missing} asked=${rigs} />
    ${rigs.data && !current && html`<p class="quiet">${t('rig.none')}</p>`}
    ${current && html`<p><b>● ${t('result.since', { at: moment(current.created_at), by: current.created_by })}</b></p><${RigShown} rig=${current.rig} />`}
    ${earlier.length > 0 && html`<details><summary>${t('rig.earlier', { count: earlier.length })}</summary>${earlier.map((one) => html`<section class="earlier" key=${one.id} aria-label=${moment(one.created_at)}>
      <h3>${moment(one.created_at)}, ${one.created_by}</h3><${RigShown} rig=${one.rig} /><${PutInForce} id=${one.id} rig=${one.rig} done=${done} /></section>`)}</details>`}
    <h3>${t('rig.another')}</h3><p class="quiet">${t('rig.about')}</p>
    ${may('operator') ? html`<label class="file"><span class="button">${t('rig.choose')}</span><input type="file" accept=".json,application/json" onChange=${choose} /></label>` : html`<p class="quiet">${t('missing.role')}</p>`}
    ${file && !file.rig && html`<p class="note warn" role="alert"><span class="mark" aria-hidden="true">!</span> ${t('rig.not-one', { name: file.name })}</p>`}
    ${file?.rig && html`<section aria-label=${file.name}><h3>${file.name}</h3><${RigShown} rig=${file.rig} /><${PutInForce} id="file" rig=${file.rig} done=${done} /></section>`}
  </${Card}>`;
}

/** Held; against the verdict only by an admin. */
function PutInForce({ id, rig, done }) {
  const despite = !rig.verdict.accepted;
  if (!may('operator')) return null;
  if (despite && !may('admin')) return html`<p class="quiet">${t('rig.rejected')}</p>`;
  const put = async (key) => {
    await ask(`/rigs${despite ? '?despite_verdict=true' : ''}`, { method: 'POST', key, body: rig });
    done();
  };
  return html`<${HoldButton} id=${`hold-rig-${id}`} moves=${false} label=${t(despite ? 'despite.apply' : 'result.apply')} act=${put} />`;
}

function RigShown({ rig }) {
  const { sensors, relative, verdict, mount } = rig;
  const frame = has(`rig.mount.${mount}`) ? t(`rig.mount.${mount}`) : mount;
  return html`<p>${verdict.accepted ? `✓ ${t('verdict.accepted')}` : `✕ ${t('verdict.refused')}`} · ${t('rig.stations', { count: rig.stations, shared: rig.shared_stations })}</p>
    <${Poses} label=${t('rig.sensors', { mount: frame })} head=${t('rig.sensor')} rows=${sensors.map((one) => ({
      name: one.name, pose: one.mount_T_sensor, uncertainty: one.uncertainty, alone_mm: one.alone_expanded_mm, views: one.views,
    }))} />
    ${relative.length > 0 && html`<${Poses} label=${t('rig.relative')} head=${t('rig.pair')} rows=${relative.map((one) => ({ name: t('rig.in', { a: one.a, b: one.b }), pose: one.a_T_b, uncertainty: one.uncertainty }))} />`}
    <${Facts} rows=${[[t('rig.robot'), `${mm(rig.robot_translation_mm)}, ${fixed(rig.robot_rotation_deg, 3)}°`], [t('rig.tolerance'), mm(rig.tolerance_mm)]]} />
    ${verdict.findings.length > 0 && html`<${Findings} findings=${verdict.findings} />`}`;
}

/** Poses with U (k = 2): along the axes, about them, and of a measured point. */
function Poses({ label, head, rows }) {
  const own = rows.some(({ views }) => views !== undefined);
  const U = (values, places) => `± ${inRow(values.map((value) => fixed(2 * value, places)))}`;
  return html`<div class="table-frame" tabindex="0" role="group" aria-label=${label}><table><caption>${label}</caption>
    <thead><tr><th scope="col">${head}</th><th scope="col">${t('rig.translation')}</th><th scope="col">${t('rig.quaternion')}</th><th scope="col" class="num">${t('rig.U')}</th>${own && html`<th scope="col" class="num">${t('rig.alone')}</th><th scope="col" class="num">${t('views.title')}</th>`}</tr></thead>
    <tbody>${rows.map(({ name, pose, uncertainty, alone_mm, views }) => html`<tr><th scope="row">${name}</th>
      <td><span class="nowrap">${vector(pose.translation_mm, 2)}</span><br /><span class="small quiet nowrap">${U(uncertainty.translation_mm, 2)}</span></td>
      <td><span class="nowrap">${vector(pose.quaternion_wxyz, 5)}</span><br /><span class="small quiet nowrap">${U(uncertainty.rotation_deg, 3)}°</span></td>
      <td class="num"><b class="nowrap">± ${mm(uncertainty.expanded_mm)}</b></td>${own && html`<td class="num nowrap">${alone_mm === null ? '—' : `± ${mm(alone_mm)}`}</td><td class="num">${views}</td>`}</tr>`)}</tbody></table></div>`;
}
