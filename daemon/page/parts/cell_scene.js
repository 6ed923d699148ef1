// The scene of the cell.
import { html } from '../vendor/preact.js';
import { mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { CanvasScene } from './canvas_scene.js';

const create = (canvas) => import('../scene/cell.js').then(({ createCellScene }) => createCellScene(canvas));

/** `parts`: as `show` of scene/cell.js takes them. `words`: the same in text, for who does not see the picture. */
export function CellScene({ parts, words, dim }) {
  return html`<${CanvasScene} create=${create} show=${(scene, dark) => scene.show(parts, dark)} shown=${parts} said=${words ?? standing(parts)} alt=${t('scene.alt')} dim=${dim} />`;
}

function standing({ flange_mm, views = [], planned = [] }) {
  const at = flange_mm ? t('scene.flange', { x: mm(flange_mm[0], 4), y: mm(flange_mm[1], 4), z: mm(flange_mm[2], 4) }) : '';
  const taken = views.length ? t('scene.views', { count: views.length }) : '';
  const ahead = planned.length ? t('scene.planned', { count: planned.length }) : '';
  return [at, taken, ahead].filter(Boolean).join(' ');
}
