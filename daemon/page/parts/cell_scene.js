// The scene of the cell in a frame whose place is reserved; three.js is fetched when the first one is shown.
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { theme } from '../state/choices.js';
import { mm } from '../state/numbers.js';
import { t } from '../state/words.js';

const night = matchMedia('(prefers-color-scheme: dark)');
export const isDark = () => (theme.value === 'auto' ? night.matches : theme.value === 'dark');

/** `parts`: as `show` of scene/cell.js takes them. `words`: the same in text, for who does not see the picture. */
export function CellScene({ parts, words, dim }) {
  const canvas = useRef(null);
  const scene = useRef(null);
  const [state, setState] = useState('loading');
  const dark = isDark();
  useEffect(() => {
    let wanted = true;
    import('../scene/cell.js').then(({ createCellScene }) => {
      if (!wanted) return;
      scene.current = createCellScene(canvas.current);
      setState(scene.current ? 'ready' : 'no-webgl');
    }).catch(() => wanted && setState('failed'));
    return () => {
      wanted = false;
      scene.current?.dispose();
      scene.current = null;
    };
  }, []);
  useEffect(() => {
    if (state === 'ready') scene.current?.show(parts, dark);
  }, [state, parts, dark]);
  const said = words ?? standing(parts);
  return html`<figure class="scene ${dim ? 'dimmed' : ''}">
    <div class="frame"><canvas ref=${canvas} tabindex="0" role="img" aria-label="${t('scene.alt')} ${said}"></canvas>
      ${['no-webgl', 'failed'].includes(state) && html`<p class="cover quiet">${t(`scene.${state}`)}</p>`}</div>
    <figcaption class="small quiet">${said} <span class="keys">${t('scene.keys')}</span></figcaption>
  </figure>`;
}

function standing({ flange_mm, views = [], planned = [] }) {
  const at = flange_mm ? t('scene.flange', { x: mm(flange_mm[0], 4), y: mm(flange_mm[1], 4), z: mm(flange_mm[2], 4) }) : '';
  const taken = views.length ? t('scene.views', { count: views.length }) : '';
  const ahead = planned.length ? t('scene.planned', { count: planned.length }) : '';
  return [at, taken, ahead].filter(Boolean).join(' ');
}
