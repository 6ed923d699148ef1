// The first set-up of a cell in three steps, the same questions as `handeyed init`: each answer is tried when it is given, nothing moves.
import { html, useEffect, useMemo, useRef, useState } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { CellScene } from '../parts/cell_scene.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { Picture } from '../parts/picture.js';
import { Cause, ProblemNote } from '../parts/problem.js';
import { partsOfTarget, printAddress, sameTarget, sizeOf, textOfTarget } from '../parts/target_words.js';
import { numberOf } from '../parts/typed.js';
import { shareBeyond } from '../scene/reach.js';
import { ask } from '../state/ask.js';
import { fixed, significant } from '../state/numbers.js';
import { lost, may } from '../state/now.js';
import { go, linkTo } from '../state/place.js';
import { useVisible } from '../state/visible.js';
import { t } from '../state/words.js';

const STEPS = ['connect', 'target', 'need'];
const FIRST = { controller: '', model: '', camera: '', setup: 'arm', target: '', size: '', tolerance: '1', box: '' };
const KINDS = ['chessboard', 'charuco', 'circles-symmetric', 'circles-asymmetric', 'apriltag-grid', 'aruco-grid', 'aruco-marker'];
const ANY_TARGET = 'charuco:12x9:1:0.75:DICT_5X5_100';
const INSTRUMENTS = ['', 'calliper', 'ruler-class-1', 'ruler-class-2'];
const TOLERANCES = { 0.2: 'measure', 0.5: 'fit', 1: 'usual', 2: 'pick' }; // mm
const AXES = ['X', 'Y', 'Z'];
const TOLERANCE_STEP = 0.1; // mm
const GAUGE_WIDTH = 400;
const TRY_S = 60;
const AGAIN_MS = 500;
const LIVE_MS = 200; // from one live picture to the next
const LIVE_AGAIN_MS = 2000; // after one that did not come

export function Setup() {
  const setup = useAsked('/setup', [], { late: true });
  return html`<link rel="stylesheet" href=${new URL('./setup.css', import.meta.url).href} />
    ${!may('admin') ? html`<p class="note">${t('missing.role')}</p>`
      : setup.error ? html`<${Missing} asked=${setup} />`
      : !setup.data ? html`<p class="quiet">${t('wizard.looking')}</p>`
      : setup.data.set_up ? html`<${Done} file=${setup.data.file} />`
      : html`<${Wizard} found=${setup.data} etag=${setup.etag} again=${setup.again} />`}`;
}

function Done({ file }) {
  return html`<section class="card"><h2>${t('wizard.done')}</h2>
    <${Facts} rows=${[file && [t('wizard.file'), html`<span class="mono">${file}</span>`]]} />
    <p>${t('wizard.anew')} <code class="mono">handeyed serve --setup ${file ?? 'handeyed.toml'}</code></p>
    <div class="row"><a class="button primary" href=${linkTo('cell')}>${t('person.cell')}</a></div></section>`;
}

/** The share of the picture inside the corners' convex hull (pure). */
export function coverage(corners, [width, height]) {
  const points = corners.map(([, u, v]) => [u, v]).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const chain = (list) => list.reduce((kept, point) => {
    while (kept.length > 1 && turn(kept.at(-2), kept.at(-1), point) <= 0) kept.pop();
    kept.push(point);
    return kept;
  }, []);
  const hull = [...chain(points).slice(0, -1), ...chain([...points].reverse()).slice(0, -1)];
  const twice = hull.reduce((sum, [x, y], at) => sum + x * hull[(at + 1) % hull.length][1] - y * hull[(at + 1) % hull.length][0], 0);
  return Math.abs(twice) / 2 / (width * height);
}

const turn = ([ax, ay], [bx, by], [cx, cy]) => (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);

/** A picture that is decoded: the last one stays until then. */
async function pictureOf(base64) {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const image = new Image();
  image.src = URL.createObjectURL(new Blob([bytes], { type: 'image/jpeg' }));
  await image.decode();
  return image.src;
}

function Wizard({ found, etag, again }) {
  const cameras = found.cameras.filter(({ problem }) => !problem);
  const usual = { ...FIRST, controller: found.controllers[0] ?? '', camera: cameras[0]?.address ?? '' };
  const [answers, setAnswers] = useState({ ...usual, ...found.before.answers });
  const [before, setBefore] = useState({ ...found.before, file: found.file }); // what is proposed, and stays; `text` of a file that was chosen here
  const [tried, setTried] = useState({}); // by question: { asked, data } of the answer that was tried, or { error }
  const [picture, setPicture] = useState(null);
  const [step, setStep] = useState(0);
  const [busy, setBusy] = useState('');
  const [problem, setProblem] = useState(null);
  const top = useRef(null);
  useEffect(() => top.current?.querySelector('input:not([type=radio]), select, button')?.focus({ preventScroll: true }), [step]);

  const visible = useVisible();
  const live = useRef(Promise.resolve()); // the live picture that is under way: a camera is opened by one at a time
  const show = async (data) => {
    if (!data.picture) return;
    const src = await pictureOf(data.picture);
    setPicture((last) => {
      if (last) URL.revokeObjectURL(last.src);
      return { ...data, src, number: (last?.number ?? 0) + 1, size: data.size ?? last?.size };
    });
  };
  useEffect(() => {
    if (STEPS[step] !== 'target' || !visible || busy || lost.value) return undefined;
    let wanted = true;
    const question = answers.target ? 'target' : 'camera';
    const look = async () => {
      try {
        const { data } = await ask('/setup/try', { method: 'POST', body: { question, answers, settings: before.text }, limit_s: TRY_S });
        if (!wanted) return 0;
        await show(data);
        if (question === 'camera' && data.target) { // it came into view
          setTried((all) => ({ ...all, camera: { asked: answers.camera, data } }));
          setAnswers((all) => ({ ...all, target: data.target }));
        }
        return LIVE_MS;
      } catch (error) {
        if (wanted) setPicture((last) => last && { ...last, problem: error.problem });
        return LIVE_AGAIN_MS;
      }
    };
    const follow = async () => {
      await live.current;
      while (wanted) {
        const began = performance.now();
        const looked = look();
        live.current = looked;
        const pause_ms = await looked;
        await new Promise((resolve) => setTimeout(resolve, began + pause_ms - performance.now()));
      }
    };
    follow();
    return () => { wanted = false; };
  }, [step, visible, busy, lost.value, answers.camera, answers.target]);

  const change = (values) => {
    setProblem(null);
    setAnswers((before) => ({ ...before, ...values }));
  };
  /** Tries one answer; what it becomes replaces it. Throws Refused. */
  const attempt = async (question, given) => {
    setBusy(question);
    setProblem(null);
    try {
      await live.current;
      const { data } = await ask('/setup/try', { method: 'POST', body: { question, answers: given, settings: before.text }, limit_s: TRY_S });
      const next = { ...given, [question]: data.answer };
      if (question === 'camera' && (!given.target || given.target === tried.camera?.data?.target)) next.target = data.target ?? '';
      if (question === 'controller' && data.model) next.model = '';
      setTried((before) => ({ ...before, [question]: { asked: next[question], data } }));
      await show(data);
      setAnswers(next);
      return { next, data };
    } catch (error) {
      setTried((before) => ({ ...before, [question]: { error } }));
      error.question = question;
      throw error;
    } finally {
      setBusy('');
    }
  };
  const fresh = (question, given) => tried[question]?.data && tried[question].asked === given[question];
  /** Tries those answers that were not tried yet, and then goes on. */
  const onward = (questions, then) => async (event) => {
    event?.preventDefault();
    if (busy || lost.value) return;
    let given = answers;
    try {
      for (const question of questions) {
        if (!fresh(question, given)) given = (await attempt(question, given)).next;
      }
      await then(given);
    } catch (error) {
      setProblem(error);
    }
  };
  const one = (question, value = answers[question]) => onwardOne(question, { ...answers, [question]: value });
  const onwardOne = async (question, given) => {
    if (busy || lost.value) return null;
    try {
      return (await attempt(question, given)).data;
    } catch (error) {
      setProblem(error);
      return null;
    }
  };
  const save = async (given) => {
    setBusy('save');
    try {
      await ask('/setup', { method: 'PUT', body: { answers: given, settings: before.text }, headers: { 'If-Match': etag }, limit_s: 90 });
      for (;;) { // the daemon begins anew with this file
        await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
        const now = await ask('/setup').then(({ data }) => data, () => null);
        if (now?.set_up) break;
      }
      go('cell');
    } finally {
      setBusy('');
    }
  };
  /** Takes what a settings file answers; nothing is tried yet. */
  const read = async (files) => {
    if (!files?.length || busy || lost.value) return;
    setBusy('read');
    setProblem(null);
    try {
      const text = await files[0].text();
      const { data } = await ask('/setup/read', { method: 'POST', body: { settings: text } });
      setBefore({ ...data, text, file: files[0].name });
      setAnswers({ ...usual, ...data.answers });
      setTried({});
      setStep(0);
    } catch (error) {
      setProblem(error);
    } finally {
      setBusy('');
    }
  };
  const drop = (event) => {
    event.preventDefault();
    if (event.type === 'drop') read(event.dataTransfer.files);
  };
  const shared = { answers, change, tried, busy, one, picture, found, cameras };
  const at = STEPS[step];
  const acts = {
    connect: onward(['controller', ...(answers.model ? ['model'] : []), 'camera'], async () => setStep(1)),
    target: onward(['target', 'size'], async () => setStep(2)),
    need: onward(['tolerance', 'box'], save),
  };
  const Body = { connect: Connect, target: Target, need: Need }[at];
  const late = problem?.code === 'setup-conflict';
  return html`<div class="wizard" onDragOver=${drop} onDrop=${drop}>
    <section class="card wizard-head"><h2>${t('wizard.title')}</h2>
      <ol class="wizard-steps">${STEPS.map((name, index) => html`<li class=${index === step ? 'now' : index < step ? 'done' : ''} aria-current=${index === step ? 'step' : undefined}><b aria-hidden="true">${index < step ? '✓' : index + 1}</b> ${t(`wizard.step.${name}`)}</li>`)}</ol>
      <p class="quiet small">${t('wizard.still')}</p>
      ${step === 0 && html`<label class="file"><span class="button">${t('wizard.from.choose')}</span><input type="file" accept=".toml" onChange=${({ target }) => read(target.files)} /></label>`}
      ${step === 0 && (before.found.length > 0 || Object.keys(before.answers).length > 0) && html`<div class="note info small wizard-from">
        ${Object.keys(before.answers).length > 0 && html`<p>${t('wizard.from', { file: before.file })}</p>`}
        ${before.found.map((line) => html`<p lang="en">${line}</p>`)}</div>`}</section>
    <form class="wizard-body" ref=${top} onSubmit=${acts[at]} aria-busy=${busy !== ''}>
      <${Body} ...${shared} />
      ${problem && html`<div class="wizard-problem"><${ProblemNote} problem=${problem} again=${late ? again : undefined} /></div>`}
      <footer class="card wizard-foot">
        ${step > 0 && html`<button type="button" onClick=${() => setStep(step - 1)}>${t('wizard.back')}</button>`}
        <p class="quiet small" role="status">${busy ? t(busy === 'save' ? 'wizard.saving' : 'wizard.trying') : at === 'need' ? t(found.sha256 ? 'wizard.keeps' : 'wizard.writes', { file: found.file }) : ''}</p>
        <button type="submit" class="primary" aria-disabled=${busy || lost.value ? 'true' : undefined}>${t(`wizard.next.${at}`)}</button>
      </footer>
    </form>
  </div>`;
}

/** What a device said of an answer: ✓ and its lines, doubts after. */
function Said({ tried, given }) {
  if (!tried?.data || tried.asked !== given) return null;
  return html`<ul class="plain wizard-said">${tried.data.found.map((line) => html`<li lang="en"><span class="mark" aria-hidden="true">✓</span> ${line}</li>`)}
    ${tried.data.doubts.map((line) => html`<li lang="en"><span class="mark" aria-hidden="true">!</span> ${line}</li>`)}</ul>`;
}

function Connect({ answers, change, tried, busy, one, picture, found, cameras }) {
  const controller = tried.controller?.data;
  const search = async () => {
    const seen = await one('controller', 'search');
    if (seen) change({ controller: seen.answer });
  };
  const hosts = [...new Set([...found.controllers, ...(controller && !controller.complete ? controller.found : [])])];
  return html`<section class="card wizard-ask"><h3>${t('wizard.connect')}</h3>
      <label for="controller">${t('wizard.controller')}</label>
      <${Found} name="controllers" entries=${hosts.map((address) => ({ address }))} value=${answers.controller} choose=${(address) => change({ controller: address })} />
      <div class="wizard-answer"><input id="controller" value=${answers.controller} onInput=${(event) => change({ controller: event.target.value })} placeholder="192.168.125.1" autocomplete="off" spellcheck="false" required aria-describedby="controller-how" />
        <button type="button" aria-disabled=${busy ? 'true' : undefined} onClick=${() => one('controller')}>${t('wizard.try')}</button></div>
      <p id="controller-how" class="small quiet">${t('wizard.controller.how')}</p>
      <div class="row"><button type="button" aria-disabled=${busy ? 'true' : undefined} onClick=${search}>${t('wizard.search')}</button></div>
      ${controller?.complete && !controller.model && html`<label for="model">${t('wizard.model')}</label><input id="model" value=${answers.model} placeholder="IRB 1600-6/1.45" autocomplete="off" onInput=${(event) => change({ model: event.target.value })} />`}
      <label for="camera">${t('wizard.camera')}</label>
      <${Found} name="cameras" entries=${cameras.map((each) => ({ ...each, about: [each.vendor, each.model, each.network_address].filter(Boolean).join(' ') }))} value=${answers.camera} choose=${(address) => change({ camera: address })} />
      <div class="wizard-answer"><input id="camera" value=${answers.camera} onInput=${(event) => change({ camera: event.target.value })} placeholder="http://192.168.10.21/frame.png" autocomplete="off" spellcheck="false" required aria-describedby="camera-how" />
        <button type="button" aria-disabled=${busy ? 'true' : undefined} onClick=${() => one('camera')}>${t('wizard.picture')}</button></div>
      <p id="camera-how" class="small quiet">${cameras.length ? t('wizard.cameras', { count: cameras.length }) : t('wizard.cameras.none')}</p>
      <fieldset><legend>${t('wizard.where')}</legend><div class="row">${['arm', 'beside'].map((place) => html`<button type="button" class="chip" aria-pressed=${answers.setup === place} onClick=${() => change({ setup: place })}>${t(`wizard.where.${place}`)}</button>`)}</div></fieldset>
    </section>
    <${Side} picture=${picture}><div class="wizard-both">
      ${armOf(tried) && html`<${ArmNow} title=${t('wizard.robot')} arm=${armOf(tried)} box_mm=${controller?.program_box_mm ?? null} />`}
      <section class="card"><h3>${t('wizard.tried')}</h3>
        ${tried.controller?.data || tried.camera?.data ? html`<${Said} tried=${tried.controller} given=${answers.controller} /><${Said} tried=${tried.camera} given=${answers.camera} />` : html`<p class="quiet">${t('wizard.tried.none')}</p>`}</section></div></${Side}>`;
}

/** What answered by itself, to choose from. */
function Found({ name, entries, value, choose }) {
  return entries.map(({ address, about }) => html`<label class="check wizard-choice"><input type="radio" name=${name} checked=${value === address} onChange=${() => choose(address)} />
    <span><b>${address}</b>${about && html`<br /><span class="small">${about}</span>`}</span></label>`);
}

/** The arm as it stood when it was last read; null before, and for one that is not listed. */
const armOf = (tried) => tried.box?.data?.arm ?? tried.model?.data?.arm ?? tried.controller?.data?.arm ?? null;

/** The arm as it stands, and the box. `dragged(axis, end, mm)`: told where a face of the box is drawn to. */
function ArmNow({ title, arm, flange_mm, box_mm, dragged }) {
  const told = useRef(dragged);
  told.current = dragged;
  const drags = Boolean(dragged && box_mm);
  const parts = useMemo(() => ({
    ...arm, flange_mm: arm?.skeleton_mm.at(-1) ?? flange_mm, box_mm, reach: drags, dragged: drags ? (...face) => told.current(...face) : undefined,
  }), [JSON.stringify([arm, flange_mm, box_mm, drags])]);
  const beyond = drags && arm?.lengths_mm ? shareBeyond(arm.lengths_mm, box_mm) : null;
  const words = beyond === null ? undefined : beyond > 0 ? t('wizard.reach.some', { percent: fixed(Math.max(1, 100 * beyond), 0) }) : t('wizard.reach.none');
  return html`<${Card} id="robot" title=${title} flush><${CellScene} parts=${parts} words=${words} /></${Card}>`;
}

function Side({ picture, children }) {
  const share = picture?.corners?.length > 2 ? coverage(picture.corners, picture.size) : 0;
  const words = !picture ? t('wizard.picture.none') : picture.corners.length ? `✓ ${t('look.corners', { count: picture.corners.length, of: picture.of })}` : `✕ ${t('look.none')}`;
  return html`<div class="wizard-side"><${Picture} src=${picture?.src} number=${picture?.number ?? null} dim=${!!picture?.problem} size=${picture?.size ?? undefined} corners=${picture?.corners ?? []} alt=${`${t('picture.camera')} ${words}`} />
    ${picture?.problem ? html`<${Cause} cause=${{ ...picture.problem, what: picture.problem.detail }} />` : html`<p role="status">${words}${share > 0 ? ` · ${t(share < 0.15 ? 'wizard.nearer' : share > 0.6 ? 'wizard.farther' : 'wizard.covers', { percent: fixed(100 * share, 0) })}` : ''}</p>`}${children}</div>`;
}

function targetWords(text) {
  const { kind, columns, rows, rest } = partsOfTarget(text);
  return [`${t(`wizard.kind.${kind}`)}${columns ? `, ${columns} × ${rows} ${t(`wizard.counted.${counted(kind)}`)}` : ''}`, rest].filter(Boolean).join(' · ');
}

const counted = (kind) => ({ chessboard: 'corners', charuco: 'squares', 'circles-symmetric': 'dots', 'circles-asymmetric': 'dots' }[kind] ?? 'markers');

function Target({ answers, change, tried, busy, one, picture }) {
  const recognised = tried.camera?.data.target ?? tried.target?.data.target ?? null;
  const [typed, setTyped] = useState(answers.target && !(recognised && sameTarget(answers.target, recognised)) ? partsOfTarget(answers.target) : null);
  const [size, setSize] = useState(sizeOf(answers.size));
  const describe = (values) => {
    const next = { kind: 'charuco', columns: '12', rows: '9', rest: 'DICT_5X5_100', ...typed, ...values };
    if (values.kind && values.kind !== typed?.kind) next.rest = { charuco: 'DICT_5X5_100', 'aruco-grid': 'DICT_5X5_100', 'aruco-marker': 'DICT_5X5_100 0', 'apriltag-grid': 'tag36h11' }[values.kind] ?? '';
    setTyped(next);
    change({ target: textOfTarget(next) });
  };
  const look = async () => {
    const seen = await one('target', '');
    if (seen) setTyped(null);
  };
  const measure = (values) => {
    const next = { ...size, ...values };
    setSize(next);
    const length = next.count === '1' ? next.length.trim() : `${next.length.trim()}/${next.count}`;
    change({ size: next.length.trim() ? [length, next.second.trim(), next.instrument].filter(Boolean).join(' ') : '' });
  };
  const kind = partsOfTarget(answers.target).kind;
  const two = ['charuco', 'apriltag-grid', 'aruco-grid'].includes(kind);
  return html`<section class="card wizard-ask"><h3>${t('wizard.target')}</h3>
      <label class="check wizard-choice"><input type="radio" name="target" checked=${!typed && !!recognised} disabled=${!recognised} onChange=${() => { setTyped(null); change({ target: recognised }); }} />
        <span>${recognised ? html`<b>${targetWords(recognised)}</b>` : t('wizard.target.none')}</span></label>
      <label class="check wizard-choice"><input type="radio" name="target" checked=${!!typed} onChange=${() => describe({ ...partsOfTarget(answers.target || ANY_TARGET) })} /><span>${t('wizard.target.other')}</span></label>
      ${typed && html`<div class="wizard-typed">
        <div><label for="kind">${t('wizard.kind')}</label><select id="kind" value=${typed.kind} onChange=${(event) => describe({ kind: event.target.value })}>${KINDS.map((name) => html`<option value=${name}>${t(`wizard.kind.${name}`)}</option>`)}</select></div>
        ${typed.kind !== 'aruco-marker' && html`<div><label for="columns">${t('wizard.columns')}</label><input id="columns" inputmode="numeric" value=${typed.columns} onInput=${(event) => describe({ columns: event.target.value })} /></div>
          <div><label for="rows">${t('wizard.rows')}</label><input id="rows" inputmode="numeric" value=${typed.rows} onInput=${(event) => describe({ rows: event.target.value })} /></div>`}
        ${!['chessboard', 'circles-symmetric', 'circles-asymmetric'].includes(typed.kind) && html`<div><label for="rest">${t('wizard.dictionary')}</label><input id="rest" value=${typed.rest} onInput=${(event) => describe({ rest: event.target.value })} /></div>`}</div>`}
      <div class="row"><button type="button" aria-disabled=${busy ? 'true' : undefined} onClick=${look}>${t('wizard.picture.again')}</button>
        <a href=${printAddress(answers.target || ANY_TARGET, numberOf(size.length) / Number(size.count), numberOf(size.second))} target="_blank">${t('wizard.print.pdf')}</a></div>
      <div class="wizard-typed"><div><label for="length">${t(`wizard.measure.${two || kind === 'aruco-marker' ? kind : counted(kind)}`)}</label><input id="length" inputmode="decimal" required value=${size.length} placeholder="200" onInput=${(event) => measure({ length: event.target.value })} /></div>
        <div><label for="count">${t('wizard.measure.count')}</label><select id="count" value=${size.count} onChange=${(event) => measure({ count: event.target.value })}>${[...new Set(['1', '5', '10', size.count])].map((many) => html`<option value=${many}>${many}</option>`)}</select></div>
        ${two && html`<div><label for="second">${t(kind === 'charuco' ? 'wizard.measure.second' : 'wizard.measure.gap')}</label><input id="second" inputmode="decimal" value=${size.second} placeholder=${t('wizard.measure.picture')} onInput=${(event) => measure({ second: event.target.value })} /></div>`}
        <div><label for="instrument">${t('wizard.measure.with')}</label><select id="instrument" value=${size.instrument} onChange=${(event) => measure({ instrument: event.target.value })}>${INSTRUMENTS.map((name) => html`<option value=${name}>${t(`wizard.with.${name || 'none'}`)}</option>`)}</select></div></div>
      <${Said} tried=${tried.size} given=${answers.size} />
      <p class="note small">${t('wizard.print.plate')} ${t('wizard.size.why')}</p>
      <div class="row"><a href="/docs/start/target/" target="_blank" rel="noreferrer">${t('wizard.print.which')}</a></div>
    </section>
    <${Side} picture=${picture}><${Said} tried=${tried.target} given=${answers.target} /></${Side}>`;
}

function Need({ answers, change, tried, busy, one }) {
  const controller = tried.controller?.data;
  const given = answers.box.trim() ? answers.box.trim().split(/\s+/) : [];
  const cells = Array.from({ length: 6 }, (_, index) => given[index] ?? '');
  const edit = (index, value) => change({ box: cells.map((old, at) => (at === index ? value.trim() : old) || '-').join(' ') });
  const shown = cells.map((value) => (value === '-' ? '' : value));
  const corner = async () => {
    const first = given.length === 3 ? given : [];
    const seen = await one('box', 'here');
    if (seen && first.length) change({ box: [...first, ...seen.answer.split(' ')].join(' ') });
  };
  const [low, high] = [Math.min, Math.max].map((end) => AXES.map((_, axis) => end(numberOf(shown[axis]), numberOf(shown[axis + 3]))));
  const box_mm = [...low, ...high].every(Number.isFinite) ? [low, high] : null;
  const draw = (axis, end, mm) => {
    const drawn = [low, high].map((ends, at) => ends.map((value, each) => (at === end && each === axis ? mm : value)));
    change({ box: drawn.flat().join(' ') });
  };
  const limit = numberOf(answers.tolerance);
  const expected = tried.size?.data?.expected_mm ?? null;
  const step = (sign) => change({ tolerance: String(Number(Math.max(TOLERANCE_STEP, (limit || 1) + sign * TOLERANCE_STEP).toFixed(2))) });
  return html`<section class="card wizard-ask"><h3>${t('wizard.need')}</h3>
      <label for="tolerance">${t('wizard.tolerance')}</label>
      <div class="wizard-answer wizard-limit"><button type="button" aria-label=${t('less')} onClick=${() => step(-1)}>−</button>
        <input id="tolerance" inputmode="decimal" required value=${answers.tolerance} onInput=${(event) => change({ tolerance: event.target.value })} aria-describedby="tolerance-how" />
        <button type="button" aria-label=${t('more')} onClick=${() => step(1)}>+</button>
        ${Object.entries(TOLERANCES).sort(([a], [b]) => a - b).map(([mm, use]) => html`<button type="button" class="chip" aria-pressed=${answers.tolerance === mm} onClick=${() => change({ tolerance: mm })}>${t(`wizard.tolerance.${use}`)}</button>`)}</div>
      ${expected !== null && limit > 0 && html`<${Gauge} expected=${expected} limit=${limit} />`}
      <p id="tolerance-how" class="small quiet">${expected !== null && `${t(expected > limit ? 'wizard.expect.above' : 'wizard.expect', { mm: significant(expected) })} `}${t('wizard.tolerance.how')}</p>
      <fieldset><legend>${t('wizard.box')}</legend>
        <div class="wizard-box">${AXES.map((axis, at) => [0, 3].map((corner) => html`<label class="wizard-axis"><span>${axis} ${corner ? '2' : '1'}</span><input inputmode="decimal" required value=${shown[at + corner]} onInput=${(event) => edit(at + corner, event.target.value)} aria-label=${`${axis} ${t(corner ? 'wizard.box.second' : 'wizard.box.first')}, mm`} /></label>`))}</div></fieldset>
      <div class="row"><button type="button" aria-disabled=${busy ? 'true' : undefined} onClick=${corner}>${t('wizard.box.here')}</button>
        ${controller?.program_box_mm && html`<button type="button" aria-disabled=${busy ? 'true' : undefined} onClick=${() => one('box', 'program')}>${t('wizard.box.program')}</button>`}</div>
      <p class="small quiet">${t('wizard.box.how')}</p>
    </section>
    <div class="wizard-side wizard-space"><${ArmNow} title=${t('wizard.box.drawn')} arm=${armOf(tried)} flange_mm=${controller?.flange_mm} box_mm=${box_mm} dragged=${draw} /></div>`;
}

/** What is expected on the scale up to the limit, each with its words at its mark (mm). */
function Gauge({ expected, limit }) {
  const end = Math.max(1.25 * limit, 1.15 * expected);
  const at = (length) => (length / end) * GAUGE_WIDTH;
  const words = (id, length) => html`<span class="small" style=${{ '--at': `${(100 * length) / end}%` }}>${t(id, { mm: significant(length) })}</span>`;
  return html`<div class="wizard-gauge"><p>${words('wizard.expect.mark', expected)}</p>
    <svg viewBox="0 0 ${GAUGE_WIDTH} 22" preserveAspectRatio="none" aria-hidden="true">
      <rect class="fine" y="5" height="12" width=${at(limit / 2)} /><rect class="warning" y="5" height="12" x=${at(limit / 2)} width=${at(limit / 2)} />
      <rect class="refused" y="5" height="12" x=${at(limit)} width=${GAUGE_WIDTH - at(limit)} /><path class="limit" d=${`M${at(limit)} 0V22`} /><path class="expected" d=${`M${at(expected)} 0V22`} /></svg>
    <p>${words('wizard.limit.mark', limit)}</p></div>`;
}
