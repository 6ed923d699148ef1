// A touch test: a known tip is brought to points that a verification saw, and the pose is read. Nothing moves by itself.
import { html, useState } from '../vendor/preact.js';
import { ask, newKey } from '../state/ask.js';
import { may, note, running } from '../state/now.js';
import { fixed, moment, vector } from '../state/numbers.js';
import { go } from '../state/place.js';
import { t } from '../state/words.js';
import { Act } from './act.js';
import { Approach } from './approach.js';
import { FAR_MM, takenBack, tipOff, touchRequest } from './touch_request.js';
import { numberOf } from './typed.js';

/** `verification`: the newest finished run that saw the target in the base; `last`: the newest touch test; `points_mm`: of the target; `moves`: whether the daemon moves the robot. */
export function TouchForm({ verification, last, points_mm = [], moves }) {
  const { points, cross, calibration_id } = verification.result.verification;
  const [own, setOwn] = useState(null); // the last answer to this form: `last` may be older for a moment
  const newest = own && !(last?.created_at >= own.created_at) ? own : last;
  const [anew, setAnew] = useState(false); // a test of its own is wanted, though one of this verification is there
  const [given, setGiven] = useState(null); // a tip.json that was chosen
  const [problem, setProblem] = useState(null);
  const [point, setPoint] = useState(null);
  const [tolerance, setTolerance] = useState('');
  const [far, setFar] = useState(null); // { id, off_mm } of a touch that is asked about
  const test = !anew && newest?.verification === verification.id ? newest : null;
  const tip = test?.tip ?? given ?? newest?.tip ?? null;
  const done = new Set(test?.touches.touches.map(({ id }) => id));
  const chosen = point ?? cross.find((id) => !done.has(id)) ?? cross[0];
  const tolerance_mm = numberOf(tolerance);
  const choose = async (event) => {
    setProblem(null);
    try {
      setGiven(tipOf(JSON.parse(await event.target.files[0].text())));
      setAnew(true);
    } catch {
      setProblem(t('touch.no-tip-file'));
    }
  };
  const touch = async () => {
    const { data: now } = await ask('/robot'); // as it stands: what is shown may be a second old
    const off_mm = tipOff({ now, tip, points, id: chosen });
    if (off_mm > FAR_MM && far?.id !== chosen) return void setFar({ id: chosen, off_mm });
    await send(touchRequest({ test, tip, verification: verification.id, id: chosen, tolerance_mm }));
  };
  const back = (index) => async () => {
    if (test.touches.touches.length > 1) await send(takenBack(test, index));
    else setAnew(true); // a test has a touch at least
  };
  const send = async (body) => {
    setFar(null);
    const { data } = await ask('/touch', { method: 'POST', key: newKey(), body, limit_s: 60 });
    setOwn(data);
    setAnew(false);
    setPoint(null);
    note('touch');
    go('verify', data.id);
  };
  const wrong = !test && tolerance.trim() !== '' && !(tolerance_mm > 0);
  const off = !may('operator') || running.value || !tip || wrong;
  return html`<p>${t('touch.about')}</p>
    <p class="small quiet">${t('touch.seen', { at: moment(verification.created_at), count: points.length })} ${t('touch.of', { id: calibration_id })}</p>
    <h3>${t('touch.point')}</h3>
    <${PointMap} points_mm=${points_mm} cross=${cross} chosen=${chosen} done=${done} />
    <div class="row" role="group" aria-label=${t('touch.point')}>${cross.map((id) => html`<button type="button" class="chip" key=${id} aria-pressed=${id === chosen} onClick=${() => setPoint(id)}>${id}${done.has(id) ? ` · ${t('touch.done')}` : ''}</button>`)}</div>
    <h3>${t('touch.tip')}</h3>
    <p>${tip ? html`<span class="mono">${vector(tip.flange_tip_mm, 2)} mm</span>` : t('touch.no-tip')}</p>
    ${test
      ? html`<p class="small quiet">${t('touch.adds', { count: test.touches.touches.length })}</p><div class="row"><button type="button" onClick=${() => setAnew(true)}>${t('touch.anew')}</button>
          ${test.touches.touches.map(({ id, name }, index) => html`<${Act} key=${index} label=${t('touch.back', { point: id ?? name ?? index + 1 })} disabled=${!may('operator')} act=${back(index)} />`)}</div>`
      : html`<label class="file"><span class="button">${t('touch.choose-tip')}</span><input type="file" accept=".json,application/json" onChange=${choose} /></label>
        <div><label for="touch-tolerance">${t('touch.tolerance')}</label><input id="touch-tolerance" inputmode="decimal" autocomplete="off" value=${tolerance} onInput=${(event) => setTolerance(event.target.value)} aria-invalid=${wrong} /></div>`}
    ${problem && html`<p class="note warn" role="alert"><span class="mark" aria-hidden="true">!</span> ${problem}</p>`}
    <${Approach} key=${chosen} test=${test} tip=${tip} verification=${verification.id} id=${chosen} moves=${moves} />
    <h3>${t('touch.read')}</h3>
    ${far?.id === chosen && html`<p class="note warn" role="alert"><span class="mark" aria-hidden="true">!</span> ${t('touch.far', { mm: fixed(far.off_mm, 1), point: chosen })}</p>`}
    <${Act} label=${t(far?.id === chosen ? 'touch.far.count' : 'touch.take', { point: chosen })} primary=${far?.id !== chosen} disabled=${off} act=${touch} />
    <p class="small quiet">${t(may('operator') ? (tip ? 'touch.reads' : 'touch.tip-first') : 'missing.role')}</p>`;
}

function tipOf({ flange_tip_mm, covariance, placing_sigma_mm, ...rest }) {
  if (!Array.isArray(flange_tip_mm) || !Array.isArray(covariance)) throw new TypeError('no tip.json');
  return { ...rest, flange_tip_mm, covariance, placing_sigma_mm };
}

const PAD = 0.08;

/** The target's points seen from the front, those of the cross with their numbers, the chosen one filled. */
function PointMap({ points_mm, cross, chosen, done }) {
  if (points_mm.length < 3) return null;
  const [xs, ys] = [0, 1].map((axis) => points_mm.map((point) => point[axis]));
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  const [wide, high] = [Math.max(...xs) - left || 1, Math.max(...ys) - top || 1];
  const pad = PAD * Math.max(wide, high);
  const r = Math.max(wide, high) / 110;
  return html`<figure class="point-map"><svg viewBox="${left - pad} ${top - pad} ${wide + 2 * pad} ${high + 2 * pad}" role="img" aria-label=${t('touch.map', { point: chosen })}>
    ${points_mm.map(([x, y], id) => html`<circle key=${id} class=${id === chosen ? 'chosen' : cross.includes(id) ? 'cross' : 'other'} cx=${x} cy=${y} r=${id === chosen ? 2.6 * r : cross.includes(id) ? 1.8 * r : r} />`)}
    ${cross.filter((id) => points_mm[id]).map((id) => html`<text key=${`t${id}`} x=${points_mm[id][0]} y=${points_mm[id][1] - 3.4 * r} text-anchor="middle" font-size=${5.5 * r}>${id}${done.has(id) ? ' ✓' : ''}</text>`)}
  </svg></figure>`;
}
