// A result: verdict and accuracy on its scale, what to know, the comparison with the active one, the pictures; more by choice.
import { html, useState } from '../vendor/preact.js';
import { ArmErrors, armIdentified } from '../parts/arm_errors.js';
import { Bar, Steps } from '../parts/bar.js';
import { Card, Facts } from '../parts/card.js';
import { Ellipsoids } from '../parts/ellipsoids.js';
import { Exports } from '../parts/exports.js';
import { Findings } from '../parts/findings.js';
import { HoldButton } from '../parts/hold_button.js';
import { PointName, Uncertainty, activator } from '../parts/in_force.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { Picture } from '../parts/picture.js';
import { SolveAgain } from '../parts/solve_again.js';
import { ViewTable } from '../parts/view_table.js';
import { ask } from '../state/ask.js';
import { deg, fixed, inRow, mm, moment, vector } from '../state/numbers.js';
import { may, note, session } from '../state/now.js';
import { camera, cameras, ofCamera } from '../state/sensors.js';
import { linkTo } from '../state/place.js';
import { deviceName, reportAt, sentence, t } from '../state/words.js';

export function Result({ argument }) {
  const list = useAsked('/calibrations?limit=100', ['calibration', 'run']);
  const rows = list.data?.calibrations ?? [];
  const id = argument || rows.find((row) => row.camera === camera.value)?.id;
  const row = rows.find((one) => one.id === id);
  const found = useAsked(id ? `/calibrations/${encodeURIComponent(id)}` : null);
  const current = useAsked(ofCamera('/calibrations/current', row?.camera ?? camera.value), ['applied', 'calibration']);
  if (list.data && !id) {
    return html`<${Card} title=${t('place.result')} id="none"><p>${t('result.never')}</p><p><a class="button primary" href=${linkTo('calibrate')}>${t('place.calibrate')}</a></p></${Card}>`;
  }
  if (!found.data) return html`<${Missing} asked=${argument ? found : list} none=${t('result.unknown')} />`;
  return html`<${Shown} document=${found.data} current=${current} row=${row} />`;
}

const MORE = ['files', 'again', 'arm', 'direction'];

function Shown({ document, current, row }) {
  const [more, setMore] = useState(null);
  const active = current.data?.applied.calibration_id === document.id;
  const path = `/calibrations/${encodeURIComponent(document.id)}`;
  const run = row?.run_id ?? null;
  const { uncertainty } = document;
  const has = {
    files: Boolean(document.flange_T_camera || document.base_T_camera), again: may('operator'),
    arm: armIdentified(document), direction: Boolean(uncertainty?.covariance && uncertainty.points.length),
  };
  return html`<div class="cockpit result">
    <${Bar} steps=${html`<${Steps} at="result" run=${run} result=${document.id} />`}>
      <a class="button" href=${reportAt(`${path}/report`)} target="_blank" rel="noreferrer">${t('result.report')}</a>
      <a class="button" href=${path} download=${`${document.id}.json`}>${t('result.json')}</a>
    </${Bar}>
    <${Card} title=${active ? t('result.in-force') : t('place.result')} id="verdict"><${Verdict} document=${document} current=${current} active=${active} run=${run} /></${Card}>
    <div class="side">
      <${Card} title=${t('result.found')} id="found"><${Findings} findings=${document.verdict.findings} /></${Card}>
      <${Card} title=${t('compare.title')} id="compare"><${Compare} document=${document} current=${current} active=${active} /></${Card}>
      <${Card} title=${t(document.setup === 'eye-to-hand' ? 'pose.title-stand' : 'pose.title')} id="pose"><${PoseFacts} document=${document} camera=${row?.camera} /></${Card}>
    </div>
    <${Views} document=${document} run=${run} />
    <div class="more">
      <div class="row" role="group" aria-label=${t('result.more')}>${MORE.filter((name) => has[name]).map((name) => html`<button type="button" class="chip" aria-pressed=${more === name} onClick=${() => setMore(more === name ? null : name)}>${t(`result.more.${name}`)}</button>`)}</div>
      ${more === 'files' && html`<${Card} title=${t('exports.title')} id="exports"><${Exports} path=${path} /></${Card}>`}
      ${more === 'again' && html`<${Card} title=${t('again.title')} id="again"><${SolveAgain} path=${path} views=${document.views} /></${Card}>`}
      ${more === 'arm' && html`<${ArmErrors} document=${document} path=${path} />`}
      ${more === 'direction' && html`<${Card} title=${t('ellipsoid.title')} id="ellipsoids"><${Ellipsoids} uncertainty=${uncertainty} worst=${document.accuracy.worst_point} /></${Card}>`}
    </div>
  </div>`;
}

function Verdict({ document, current, active, run }) {
  const { accepted, rule } = document.verdict;
  const made = useAsked(run && !active ? `/runs/${encodeURIComponent(run)}` : null);
  const result = made.data?.result?.calibration_id === document.id ? made.data.result : null;
  const waits = result?.not_applied && sentence(result.not_applied);
  const path = `/calibrations/${encodeURIComponent(document.id)}`;
  const apply = (extra) => async (key) => {
    const headers = current.etag ? { 'If-Match': current.etag } : {};
    await ask(`${path}/apply`, { method: 'POST', key, headers, body: { applied_by: session.value.name, ...extra } });
    note('applied');
    current.again();
  };
  const said = rule && sentence(rule);
  return html`
    <p class="sentence">${accepted ? `✓ ${t('verdict.accepted')}` : `✕ ${t('verdict.refused')}`}</p>
    <${Uncertainty} accuracy=${active ? current.data : document.accuracy} limits=${document.verdict.limits} />
    ${waits && html`<p class="note warn" lang=${waits.lang}><span class="mark" aria-hidden="true">!</span> ${waits.text}</p>`}
    ${active ? html`<p><b>● ${t('result.since', { at: moment(current.data.applied.applied_at), by: activator(current.data.applied.applied_by) })}</b></p>`
      : accepted && may('operator') && html`<${HoldButton} id="hold-apply" primary moves=${false} label=${t('result.apply')} act=${apply({})} />`}
    ${!accepted && !active && (document.flange_T_camera ?? document.base_T_camera) && may('admin') && html`<${Despite} document=${document} apply=${apply} />`}
    ${said && html`<p class="small quiet" lang=${said.lang}>${said.text}</p>`}`;
}

function Despite({ document, apply }) {
  const [reason, setReason] = useState('');
  return html`<details><summary>${t('despite.title')}</summary>
    <ul class="plain">${document.verdict.findings.filter(({ severity }) => severity === 'error').map((finding) => {
      const said = sentence({ id: finding.id, params: finding.params, message: finding.message });
      return html`<li lang=${said.lang}>✕ ${said.text}</li>`;
    })}</ul>
    <label for="despite">${t('despite.reason')}</label>
    <input id="despite" value=${reason} maxlength="200" onInput=${(event) => setReason(event.target.value)} />
    <${HoldButton} id="hold-despite" moves=${false} label=${t('despite.apply')} disabled=${reason.trim().length < 5} why=${t('despite.why')} act=${apply({ despite_verdict: true, reason: reason.trim() })} />
  </details>`;
}

function Compare({ document, current, active }) {
  const path = current.data && !active ? `/calibrations/${encodeURIComponent(document.id)}/compare?with=current` : null;
  const compared = useAsked(path);
  if (current.error?.status === 404) return html`<p class="quiet">${t('cell.no-force')}</p>`;
  if (active) return html`<p class="quiet">${t('compare.same')}</p>`;
  if (!compared.data) return html`<${Missing} asked=${compared} none=${t('compare.none')} />`;
  const { translation_mm, rotation_deg, points, agree, summary } = compared.data;
  const worst = points?.reduce((a, b) => (b.difference_mm > a.difference_mm ? b : a), points[0]);
  const said = sentence(summary);
  return html`<p class="sentence">${agree === null ? '○' : agree ? '=' : '≠'} ${t(agree === null ? 'compare.unknown' : agree ? 'compare.agree' : 'compare.differ')}</p>
    <table><thead><tr><th scope="col">${t('compare.what')}</th><th scope="col" class="num">${t('compare.by')}</th><th scope="col" class="num">${t('compare.known')}</th></tr></thead>
    <tbody>
      ${worst && html`<tr><th scope="row">${t('compare.point')} <${PointName} name=${worst.name} /></th><td class="num">${mm(worst.difference_mm)}</td><td class="num">${worst.expanded_mm === null ? '—' : `± ${mm(worst.expanded_mm)}`}</td></tr>`}
      <tr><th scope="row">${t('compare.translation')}</th><td class="num">${mm(translation_mm)}</td><td class="num">—</td></tr>
      <tr><th scope="row">${t('compare.rotation')}</th><td class="num">${deg(rotation_deg)}</td><td class="num">—</td></tr>
    </tbody></table>
    <p class="quiet" lang=${said.lang}>${said.text}</p>`;
}

function Views({ document, run }) {
  const [chosen, setChosen] = useState(null);
  const [free, setFree] = useState(false);
  const seen = useAsked(run ? `/runs/${encodeURIComponent(run)}/views` : null);
  const shown_px = new Map(seen.data?.views.map((one) => [one.index, free ? one.rms_px_free : one.rms_px])); // as the arrows, and as Run has it
  const rows = document.views.map((view) => ({
    ...view, rms_px: shown_px.get(view.index) ?? view.reprojection_px, robot_mm: view.robot_correction ? Math.hypot(...view.robot_correction.translation_mm) : null,
  }));
  const worst = rows.reduce((a, b) => ((b.base_error_mm ?? 0) > (a?.base_error_mm ?? -1) ? b : a), null);
  const index = chosen ?? worst?.index;
  const view = seen.data?.views.find((one) => one.index === index);
  const corners = (view?.corners ?? []).map(([id, u, v, du, dv, duFree, dvFree]) => (free ? [id, u, v, duFree, dvFree] : [id, u, v, du, dv]));
  return html`<div class="side">
    <${Card} title=${t('view.title', { view: index ?? '—' })} id="view" flush>
      <${Picture} src=${run && index !== undefined ? `/runs/${encodeURIComponent(run)}/frames/${index}?width=960` : null} size=${view?.size ?? document.camera?.image_size} corners=${corners} arrows
        alt=${t('view.alt', { view: index ?? '—', count: corners.length })} /></${Card}>
    <${Card} title=${t('views.title')} id="views"><${ViewTable} rows=${rows} chosen=${index} choose=${setChosen} result />
      ${corners.length > 0 && html`<label class="check"><input type="checkbox" checked=${free} onChange=${() => setFree(!free)} /><span>${t('view.free')}</span></label>
        <p class="small quiet">${t(free ? 'view.free-about' : 'view.reported-about')}</p>`}
    </${Card}></div>`;
}

function PoseFacts({ document, camera: name }) {
  const pose = document.flange_T_camera ?? document.base_T_camera;
  if (!pose) return html`<p>${t('pose.none')}</p>`;
  const { uncertainty } = document;
  const U = (values) => values && html` <span class="quiet">± ${inRow(values.map((value) => fixed(2 * value, 3)))} mm</span>`;
  return html`<${Facts} rows=${[
    cameras.value.length > 1 && name && [t('device.name.camera'), deviceName(name)],
    [t('pose.translation'), html`<span class="mono">${vector(pose.translation_mm, 3)} mm</span>${U(uncertainty?.translation_mm)}`],
    [t('pose.quaternion'), html`<span class="mono">${vector(pose.quaternion_wxyz, 7)}</span>`],
    uncertainty && [t('pose.rotation'), html`<span class="quiet">± ${inRow(uncertainty.rotation_deg.map((value) => fixed(2 * value, 4)))}°</span>`],
    [t('pose.views'), `${document.observability.views_used} / ${document.views.length}`],
    [t('pose.method'), `${document.setup} · ${document.method}`], [t('pose.made'), moment(document.created_at)], [t('pose.id'), document.id],
  ]} />`;
}
