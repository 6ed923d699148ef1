// Scans: the list, a new one from the scanner or from files, and one scan with its cloud in 3D.
import { html, useEffect, useState } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Card, Facts } from '../parts/card.js';
import { CloudView } from '../parts/cloud_view.js';
import { Findings } from '../parts/findings.js';
import { HoldButton } from '../parts/hold_button.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { ProblemNote } from '../parts/problem.js';
import { Progress } from '../parts/progress.js';
import { ask, newKey } from '../state/ask.js';
import { about, bytes, count, fixed, mm, moment } from '../state/numbers.js';
import { may, note, progress, running } from '../state/now.js';
import { readyWith, scanner, scannerNamed, scanners } from '../state/sensors.js';
import { go, linkTo } from '../state/place.js';
import { upload } from '../state/upload.js';
import { deviceName, reportAt, t } from '../state/words.js';

const TYPES = { ply: 'application/x-ply', pcd: 'application/x-pcd', laz: 'application/vnd.laszip', npz: 'application/x-npz' };

export const Scans = ({ argument }) => (argument ? html`<${Scan} id=${argument} />` : html`<${List} />`);

/** The sum of a number of each view; null where a view from before it was stored has none. */
const sumOf = (views, name) => views.reduce((sum, view) => (sum === null || view[name] === null ? null : sum + view[name]), 0);

const makersOf = (views) => [...new Set(views.map((view) => view.created_by).filter(Boolean))].join(', ');

/** How many views, points and bytes, and who made them, as far as that is known. */
function inWords(views) {
  const points = sumOf(views, 'points');
  const size = views.length > 0 && points !== null && t('scan.size-of', { points: about(points), bytes: bytes(sumOf(views, 'bytes')) });
  return [t('scan.views', { count: views.length }), size, makersOf(views)].filter(Boolean).join(' · ');
}

function List() {
  const scans = useAsked('/scans', ['scan', 'run']);
  const { poses = 0, camera } = scanners.value.find((one) => one.name === scanner.value) ?? {};
  const [name, setName] = useState('');
  const off = !may('operator') || running.value || !readyWith(camera)?.calibrate?.ready || !poses;
  const begin = async (key) => {
    const body = { name: name.trim() || t('scan.unnamed'), capture: true, ...scannerNamed(scanner.value) };
    await ask('/scans', { method: 'POST', key, body });
    note('run');
    go('run');
  };
  return html`<div class="grid">
    <${Card} title=${t('place.scans')} id="scans" wide="2"><${Missing} asked=${scans} />
      ${scans.data && !scans.data.scans.length && html`<p class="quiet">${t('scans.none')}</p>`}
      <ul class="timeline">${scans.data?.scans.map((scan) => html`<li key=${scan.id}><a href=${linkTo('scans', scan.id)}><span class="sign" aria-hidden="true">◇</span><span class="when">${moment(scan.created_at)}</span>
        <span class="what"><b>${scan.name}</b> ${inWords(scan.views)}</span></a></li>`)}</ul>
    </${Card}>
    <${Card} title=${t('scan.new')} id="new">
      <label for="scan-name">${t('scan.name')}</label><input id="scan-name" value=${name} maxlength="60" autocomplete="off" onInput=${(event) => setName(event.target.value)} />
      <p class="quiet">${t('scan.moves', { count: poses })}</p>
      <${HoldButton} id="hold-scan" label=${t('scan.start')} act=${begin} disabled=${off} why=${t(may('operator') ? 'scan.not-yet' : 'missing.role')} />
      <h3>${t('scan.files')}</h3><${Upload} name=${name} />
    </${Card}>
  </div>`;
}

/** Files as the views of a new scan, or of `scan`; each seen from where the arm stands now. */
function Upload({ name, scan, done }) {
  const [state, setState] = useState(null);
  const [problem, setProblem] = useState(null);
  const send = async (event) => {
    const files = [...event.target.files];
    if (!files.length) return;
    setProblem(null);
    try {
      const id = scan ?? (await ask('/scans', { method: 'POST', key: newKey(), body: { name: name.trim() || files[0].name.slice(0, 60), ...scannerNamed(scanner.value) } })).data.id;
      for (const [index, file] of files.entries()) {
        const sent = { index: index + 1, of: files.length, size: file.size };
        setState({ ...sent, share: 0 });
        const type = TYPES[file.name.split('.').pop().toLowerCase()] ?? 'application/octet-stream';
        await upload(`/scans/${encodeURIComponent(id)}/views?pose=now`, { key: newKey(), body: file, type, progress: (share) => setState({ ...sent, share }) });
      }
      note('scan');
      if (scan) done?.();
      else go('scans', id);
    } catch (error) {
      setProblem(error);
    }
    setState(null);
  };
  if (!may('operator')) return html`<p class="quiet">${t('missing.role')}</p>`;
  return html`<label class="file"><span class="button">${t('scan.choose')}</span><input type="file" multiple accept=${Object.keys(TYPES).map((suffix) => `.${suffix}`).join()} onChange=${send} /></label>
    <p class="small quiet" role="status">${state ? t('scan.sending', state) : t('scan.pose-now')}</p>
    ${state && html`<div class="sent"><progress max="1" value=${state.share} aria-label=${t('scan.sending', state)}></progress>
      <span>${state.share < 1 ? t('scan.part', { percent: fixed(100 * state.share, 0), bytes: bytes(state.size) }) : t('scan.taking')}</span></div>`}
    ${problem && html`<${ProblemNote} problem=${problem} />`}`;
}

const stageWords = (step, of) => (step?.state === 'reading' ? ['scan.reading', { view: step.views_read + 1, of }] : ['scan.registering', {}]);

function Scan({ id }) {
  const path = `/scans/${encodeURIComponent(id)}`;
  const scan = useAsked(path, ['scan', 'run']);
  const [refine, setRefine] = useState(false);
  const views = scan.data?.views ?? [];
  const report = useAsked(views.length ? `${path}/report?refine=${refine}&wait=15` : null, [], { late: true });
  const told = progress.value.registration;
  const step = told?.scan_id === id && told.refine === refine ? told : null;
  const over = ['finished', 'failed'].includes(step?.state);
  const waiting = Boolean(report.data) && !report.data.views;
  const fitting = waiting || (!report.data && !report.error && step && !over);
  useEffect(() => {
    if (waiting && over) report.again();
  }, [waiting, over]);
  if (!scan.data) return html`<${Missing} asked=${scan} none=${t('scan.unknown')} />`;
  const quality = report.data?.views ? report.data : null;
  return html`<div class="grid">
    <${Card} title=${scan.data.name} id="cloud" wide="2">
      ${views.length ? html`<${CloudView} scan=${id} views=${views} />` : html`<p class="quiet">${t('scan.empty')}</p>`}
    </${Card}>
    <${Card} title=${t('scan.about')} id="about-scan">
      <${Facts} rows=${[[t('run.since'), moment(scan.data.created_at)], [t('scan.count'), count(views.length)], makersOf(views) && [t('scan.made-by'), makersOf(views)],
        views.length > 0 && sumOf(views, 'bytes') !== null && [t('scan.size'), bytes(sumOf(views, 'bytes'))],
        scanners.value.length > 1 && [t('device.name.scanner'), deviceName(scan.data.scanner)],
        (quality || sumOf(views, 'points') !== null) && [t('scan.points'), count(quality?.points ?? sumOf(views, 'points'))], quality && [t('scan.rms'), mm(quality.rms_mm.after ?? quality.rms_mm.before)]]} />
      <label class="check"><input type="checkbox" checked=${refine} onChange=${() => setRefine(!refine)} /><span>${t('scan.refine')}</span></label>
      <div class="row"><a class="button" href=${`${path}/cloud?refine=${refine}&wait=60`} download=${`${id}.ply`}>${t('download')}</a>
        <a class="button" href=${reportAt(`${path}/report.html`)} target="_blank" rel="noreferrer">${t('result.report')}</a></div>
      <h3>${t('scan.more')}</h3><${Upload} scan=${id} done=${scan.again} />
    </${Card}>
    <${Card} title=${t('scan.registration')} id="registration" wide="2">
      ${fitting ? html`<${Progress} share=${Math.max(report.data?.progress ?? 0, step?.progress ?? 0)} words=${stageWords(step, views.length)} />` : html`<${Missing} asked=${report} />`}
      ${waiting && html`<${Act} label=${t('problem.again')} act=${async () => report.again()} />`}
      ${quality && html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('scan.registration')}><table><thead><tr><th scope="col">${t('views.view')}</th><th scope="col" class="num">${t('scan.points')}</th><th scope="col" class="num">${t('scan.overlap')}</th><th scope="col" class="num">${t('scan.rms')}</th></tr></thead>
        <tbody>${quality.views.map((view) => html`<tr><th scope="row">${view.index + 1}</th><td class="num">${count(view.points)}</td><td class="num">${fixed(100 * view.overlap, 0)} %</td><td class="num">${mm(view.rms_mm)}</td></tr>`)}</tbody></table></div>`}
    </${Card}>
    ${quality && html`<${Card} title=${t('result.found')} id="found"><${Findings} findings=${quality.verdict.findings} /></${Card}>`}
  </div>`;
}
