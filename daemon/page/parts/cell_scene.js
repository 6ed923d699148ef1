// The scene of the cell.
import { html, useMemo } from '../vendor/preact.js';
import { robot, run } from '../state/now.js';
import { mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { CanvasScene } from './canvas_scene.js';
import { useAsked } from './loaded.js';

const create = (canvas) => import('../scene/cell.js').then(({ createCellScene }) => createCellScene(canvas));

/** `parts`: as `show` of scene/cell.js takes them; the arm's lengths and joints are added. `words`: the same in text, for who does not see the picture. */
export function CellScene({ parts, words, dim }) {
  const lengths_mm = useAsked('/arm', [], { late: true }).data?.lengths_mm;
  const joints_deg = robot.value?.joints_deg;
  const ahead = run.value && !run.value.over ? run.value.planning?.planned_poses?.[0] : null;
  const ghost_deg = parts.next ? ahead?.joints_deg : null;
  const shown = useMemo(() => ({ lengths_mm, joints_deg, ghost_deg, ...parts }), [parts, lengths_mm, joints_deg, ghost_deg]);
  return html`<${CanvasScene} create=${create} show=${(scene, dark) => scene.show(shown, dark)} shown=${shown} said=${words ?? standing(parts)} alt=${t('scene.alt')} dim=${dim} />`;
}

function standing({ flange_mm, views = [], planned = [] }) {
  const at = flange_mm ? t('scene.flange', { x: mm(flange_mm[0], 4), y: mm(flange_mm[1], 4), z: mm(flange_mm[2], 4) }) : '';
  const taken = views.length ? t('scene.views', { count: views.length }) : '';
  const ahead = planned.length ? t('scene.planned', { count: planned.length }) : '';
  return [at, taken, ahead].filter(Boolean).join(' ');
}
