// The merged cloud of a scan: coarse at once, then finer; coloured by view or height; a point picked, two measured, the top cut off.
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { bytes, count, fixed, mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { FIRST_VOXEL_MM, finerVoxel, joinParts } from '../scene/cloud_data.js';
import { ProblemNote } from './problem.js';

export function CloudView({ scan, views }) {
  const canvas = useRef(null);
  const scene = useRef(null);
  const [state, setState] = useState({ words: t('missing.wait') });
  const [colouring, setColouring] = useState('view');
  const [picked, setPicked] = useState([]);
  const [bounds, setBounds] = useState(null);
  const [cut, setCut] = useState(1);

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
      scene.current = createCloudScene(canvas.current, { onPick: (point) => setPicked((before) => [...before.slice(-1), point]) });
      if (!scene.current) return setState({ words: t('scene.no-webgl') });
      try {
        const first = await fetchCloud(scan, views, FIRST_VOXEL_MM);
        if (!wanted) return undefined;
        setBounds(scene.current.show(first.cloud));
        setState({ points: first.cloud.points, fetched: first.fetched });
        const finer = finerVoxel(FIRST_VOXEL_MM, first.cloud.points);
        if (finer > 0.8 * FIRST_VOXEL_MM) return undefined;
        const second = await fetchCloud(scan, views, finer);
        if (!wanted) return undefined;
        setBounds(scene.current.show(second.cloud, true));
        setState({ points: second.cloud.points, fetched: first.fetched + second.fetched, voxel: finer });
      } catch (problem) {
        if (wanted) setState({ problem });
      }
      return undefined;
    }
  }, [scan, views.length]);

  const colour = (name) => {
    setColouring(name);
    scene.current?.set('colouring', name === 'view' ? 0 : 1);
  };
  const clip = (event) => {
    const share = Number(event.target.value);
    setCut(share);
    if (bounds) scene.current?.set('cut', share >= 1 ? 1e9 : bounds[0][2] + share * (bounds[1][2] - bounds[0][2]));
  };
  const [a, b] = picked;
  const apart = b && Math.hypot(...a.point.map((value, axis) => value - b.point[axis]));
  return html`<figure class="scene cloud"><div class="frame"><canvas ref=${canvas} tabindex="0" role="img" aria-label=${t('cloud.alt', { count: count(state.points ?? 0) })}></canvas></div>
      <figcaption class="small quiet" role="status">${state.words ?? (state.points ? t('cloud.points', { count: count(state.points), bytes: bytes(state.fetched) }) : '')} <span class="keys">${t('scene.keys')}</span></figcaption></figure>
    ${state.problem && html`<${ProblemNote} problem=${state.problem} />`}
    <div class="row" role="group" aria-label=${t('cloud.colour')}>
      ${['view', 'height'].map((name) => html`<button type="button" class="chip" aria-pressed=${colouring === name} onClick=${() => colour(name)}>${t(`cloud.${name}`)}</button>`)}
      <label class="slider"><span>${t('cloud.cut')}</span><input type="range" min="0.02" max="1" step="0.01" value=${cut} onInput=${clip} /></label>
    </div>
    <div role="status">${picked.map(({ point, view }, index) => html`<p class="small">${index + 1}: <span class="mono">(${point.map((value) => fixed(value, 2)).join(', ')}) mm</span> · ${t('view.title', { view })}</p>`)}
      ${apart !== undefined && html`<p><b>${t('cloud.apart', { mm: mm(apart, 5) })}</b></p>`}</div>
    ${picked.length ? html`<button type="button" onClick=${() => { setPicked([]); scene.current?.clear(); }}>${t('cloud.clear')}</button>` : html`<p class="small quiet">${t('cloud.pick')}</p>`}`;
}

async function fetchCloud(scan, views, voxel_mm) {
  const parts = [];
  let fetched = 0;
  for (const { view } of views) {
    const path = `/scans/${encodeURIComponent(scan)}/cloud?view=${view}&voxel_mm=${voxel_mm}&wait=50`;
    const { data, status } = await ask(path, { kind: 'bytes', headers: { Accept: 'application/octet-stream' }, limit_s: 60 });
    if (status === 202) continue;
    fetched += data.byteLength;
    parts.push({ view, xyz: new Float32Array(data) });
  }
  return { cloud: joinParts(parts), fetched };
}
