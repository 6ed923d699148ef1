// A scene on a canvas whose place is reserved; its module, and three.js with it, is fetched when the rest is drawn.
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { theme } from '../state/choices.js';
import { idle } from '../state/idle.js';
import { t } from '../state/words.js';

const night = matchMedia('(prefers-color-scheme: dark)');
const isDark = () => (theme.value === 'auto' ? night.matches : theme.value === 'dark');

/** `create(canvas)`: to a scene on it, or to null; `show(scene, dark)` when `shown` changes. `said`: the same in text. */
export function CanvasScene({ create, show, shown, said, alt, dim }) {
  const canvas = useRef(null);
  const scene = useRef(null);
  const [state, setState] = useState('loading');
  const dark = isDark();
  useEffect(() => {
    let wanted = true;
    idle().then(() => wanted && create(canvas.current).then((made) => {
      if (!wanted) return void made?.dispose();
      scene.current = made;
      setState(scene.current ? 'ready' : 'no-drawing');
    }).catch(() => wanted && setState('failed')));
    return () => {
      wanted = false;
      scene.current?.dispose();
      scene.current = null;
    };
  }, []);
  useEffect(() => {
    if (state === 'ready' && scene.current) show(scene.current, dark);
  }, [state, shown, dark]);
  return html`<figure class="scene ${dim ? 'dimmed' : ''}">
    <div class="frame"><canvas ref=${canvas} tabindex="0" role="img" aria-label="${alt} ${said}"></canvas>
      ${['no-drawing', 'failed'].includes(state) && html`<p class="cover quiet">${t(`scene.${state}`)}</p>`}</div>
    <figcaption class="small quiet">${said} <span class=${scene.current?.flat ? '' : 'keys'}>${t(scene.current?.flat ? 'scene.flat' : 'scene.keys')}</span></figcaption>
  </figure>`;
}
