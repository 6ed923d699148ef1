// The merged cloud of a scan: coarse at once, then finer; coloured by view, height, deviation or normal; the part looked at finer still; a point picked, two measured, the top cut off.
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { progress } from '../state/now.js';
import { bytes, count, fixed, mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { FIRST_VOXEL_MM, MAX_POINTS, MAX_SURFACE_POINTS, boxAround, deviationEnd, finerVoxel, joinParts, joinSurfaces, shareOf, shareOfParts } from '../scene/cloud_data.js';
import { ProblemNote } from './problem.js';
import { Progress } from './progress.js';

const COLOURINGS = ['view', 'height', 'deviation', 'normal'];
const DETAIL_SHARE = 0.25; // of the cloud's diagonal: who looks at more than that sees the whole
const LEAST_VOXEL_MM = 0.05;

export function CloudView({ scan, views }) {
  const canvas = useRef(null);
  const scene = useRef(null);
  const [state, setState] = useState({ words: t('missing.wait') });
  const [colouring, setColouring] = useState('view');
  const [picked, setPicked] = useState([]);
  const [bounds, setBounds] = useState(null);
  const [cut, setCut] = useState(1);
  const [part, setPart] = useState(null); // of the views asked for, the one on its way: { index, of, view, work, before: the last event of a cloud when it was asked for }

  useEffect(() => {
    let wanted = true;
    load();
    return () => {
      wanted = false;
      scene.current?.dispose();
      scene.current = null;
    };
    async function load() {
      const { createCloudScene } = await import('../scene/cloud.js').catch(() => ({}));
      if (!wanted) return undefined;
      if (!createCloudScene) return setState({ words: t('scene.failed') });
      const made = await createCloudScene(canvas.current, { onPick: (point) => setPicked((before) => [...before.slice(-1), point]), onRest: (part) => rest.current(part) });
      if (!wanted) return void made?.dispose();
      if (!made) return setState({ words: t('scene.no-drawing') });
      scene.current = made;
      try {
        const first = await fetchCloud(scan, views, FIRST_VOXEL_MM, MAX_POINTS.first, null, setPart);
        setPart(null);
        if (!wanted) return undefined;
        setBounds(scene.current.show(first.cloud));
        setState({ points: first.cloud.points, first: first.cloud.points, fetched: first.fetched, voxel: FIRST_VOXEL_MM });
        const finer = finerVoxel(FIRST_VOXEL_MM, first.cloud.points);
        if (finer > 0.8 * FIRST_VOXEL_MM) return undefined;
        const second = await fetchCloud(scan, views, finer, MAX_POINTS.finer);
        if (!wanted) return undefined;
        setBounds(scene.current.show(second.cloud, true));
        setState({ points: second.cloud.points, first: first.cloud.points, fetched: first.fetched + second.fetched, voxel: finer });
      } catch (problem) {
        setPart(null);
        if (wanted) setState({ problem });
      }
      return undefined;
    }
  }, [scan, views.length]);

  const rest = useRef(() => {});
  rest.current = async ({ middle, reach }) => {
    const { voxel, coarse } = state;
    if (!bounds || !voxel || coarse || reach > DETAIL_SHARE * Math.hypot(...bounds[0].map((low, axis) => bounds[1][axis] - low))) return;
    const whole = Math.hypot(...bounds[0].map((low, axis) => bounds[1][axis] - low)) / 2;
    const asked = (detailAsked.current += 1);
    try {
      const { cloud, fetched } = await fetchCloud(scan, views, Number(Math.max(LEAST_VOXEL_MM, (voxel * reach) / whole).toPrecision(2)), MAX_POINTS.finer, boxAround(middle, reach));
      if (asked !== detailAsked.current || !scene.current || cloud.points === 0) return;
      scene.current.showDetail(cloud);
      setState((before) => ({ ...before, fetched: before.fetched + fetched, detail: cloud.points }));
    } catch (problem) {
      if (asked === detailAsked.current) setState((before) => ({ ...before, problem }));
    }
  };
  const detailAsked = useRef(0);

  const colour = async (name) => {
    setColouring(name);
    if (['deviation', 'normal'].includes(name) && !state.coarse) {
      setState((before) => ({ ...before, words: t('missing.wait') }));
      try {
        const { cloud, fetched } = await fetchSurfaces(scan, views, finerVoxel(FIRST_VOXEL_MM, state.first, MAX_SURFACE_POINTS), setPart);
        setPart(null);
        if (!scene.current) return;
        const span = deviationEnd(cloud.deviation);
        scene.current.show(cloud, true);
        scene.current.set('span', span ?? 1);
        setState((before) => ({ ...before, words: null, points: cloud.points, fetched: before.fetched + fetched, coarse: true, span, detail: 0 }));
      } catch (problem) {
        setPart(null);
        setState((before) => ({ ...before, words: null, problem }));
        return;
      }
    }
    scene.current?.set('colouring', COLOURINGS.indexOf(name));
  };
  const clip = (event) => {
    const share = Number(event.target.value);
    setCut(share);
    if (bounds) scene.current?.set('cut', share >= 1 ? 1e9 : bounds[0][2] + share * (bounds[1][2] - bounds[0][2]));
  };
  const [a, b] = picked;
  const apart = b && Math.hypot(...a.point.map((value, axis) => value - b.point[axis]));
  return html`<figure class="scene cloud"><div class="frame"><canvas ref=${canvas} tabindex="0" role="img" aria-label=${t('cloud.alt', { count: count(state.points ?? 0) })}></canvas>
      ${part && html`<${Progress} share=${shareOfParts(part, scan, progress.value.cloud)} words=${['cloud.progress', { view: part.index + 1, of: part.of }]} />`}</div>
      <figcaption class="small quiet" role="status">${state.words ?? (state.points ? t('cloud.points', { count: count(state.points + (state.detail ?? 0)), bytes: bytes(state.fetched) }) : '')} <span class="keys">${t(scene.current?.flat ? 'scene.flat' : 'scene.keys')}</span></figcaption></figure>
    ${state.problem && html`<${ProblemNote} problem=${state.problem} />`}
    <div class="row" role="group" aria-label=${t('cloud.colour')}>
      ${COLOURINGS.map((name) => html`<button type="button" class="chip" aria-pressed=${colouring === name} onClick=${() => colour(name)}>${t(`cloud.${name}`)}</button>`)}
      <label class="slider"><span>${t('cloud.cut')}</span><input type="range" min="0.02" max="1" step="0.01" value=${cut} onInput=${clip} /></label>
    </div>
    ${colouring === 'deviation' && state.coarse && html`<p class="small quiet scale-words">${state.span ? html`<span class="ramp" aria-hidden="true"></span>${t('cloud.deviation-scale', { end: mm(state.span, 1) })}` : t('cloud.deviation-none')}</p>`}
    <div role="status">${picked.map(({ point, view }, index) => html`<p class="small">${index + 1}: <span class="mono">(${point.map((value) => fixed(value, 2)).join(', ')}) mm</span> · ${t('view.title', { view })}</p>`)}
      ${apart !== undefined && html`<p><b>${t('cloud.apart', { mm: mm(apart, 5) })}</b></p>`}</div>
    ${picked.length ? html`<button type="button" onClick=${() => { setPicked([]); scene.current?.clear(); }}>${t('cloud.clear')}</button>` : !scene.current?.flat && html`<p class="small quiet">${t('cloud.pick')}</p>`}`;
}

async function fetchSurfaces(scan, views, voxel_mm, begin) {
  const parts = [];
  let fetched = 0;
  for (const [index, { view }] of views.entries()) {
    begin({ index, of: views.length, view, work: 'surface', before: progress.value.cloud });
    const path = `/scans/${encodeURIComponent(scan)}/surface?view=${view}&voxel_mm=${voxel_mm}`;
    const { data } = await ask(path, { kind: 'bytes', headers: { Accept: 'application/octet-stream' }, limit_s: 120 });
    fetched += data.byteLength;
    parts.push({ view, records: new Float32Array(data) });
  }
  return { cloud: joinSurfaces(parts), fetched };
}

async function fetchCloud(scan, views, voxel_mm, most, box, begin) {
  const parts = [];
  let fetched = 0;
  for (const [index, { view }] of views.entries()) {
    begin?.({ index, of: views.length, view, work: 'merge', before: progress.value.cloud });
    const path = `/scans/${encodeURIComponent(scan)}/cloud?view=${view}&voxel_mm=${voxel_mm}&max_points=${shareOf(most, views.length)}&wait=50${box ? `&box=${box}` : ''}`;
    const { data, status } = await ask(path, { kind: 'bytes', headers: { Accept: 'application/octet-stream' }, limit_s: 60 });
    if (status === 202) continue;
    fetched += data.byteLength;
    parts.push({ view, xyz: new Float32Array(data) });
  }
  return { cloud: joinParts(parts), fetched };
}
