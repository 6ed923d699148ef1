// Where a measured point may be, at each of the points that matter, as seen from the camera.
import { html, useMemo } from '../vendor/preact.js';
import { count, mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { CanvasScene } from './canvas_scene.js';
import { enlargement, halfAxes, pointCovariance } from './ellipsoid.js';

const create = (canvas) => import('../scene/ellipsoids.js').then(({ createEllipsoidScene }) => createEllipsoidScene(canvas));
const SHARE = 0.12; // of the distance: the longest half axis as drawn, at most

/** `uncertainty` of a calibration with its covariance and points; `worst`: name of the worst of them. */
export function Ellipsoids({ uncertainty: { covariance, points }, worst: name }) {
  const found = useMemo(() => {
    const worst = points.find((point) => point.name === name) ?? points[0];
    const shown = points.map((point) => ({ name: point.name, camera_mm: point.camera_mm, axes: halfAxes(pointCovariance(covariance, point.camera_mm)), worst: point === worst }));
    const times = Math.min(...shown.map(({ axes, camera_mm }) => enlargement(axes[0].length_mm, SHARE * Math.hypot(...camera_mm))));
    return { shown, times, worst: shown.find((point) => point.worst) };
  }, [covariance, points, name]);
  const { axes, camera_mm } = found.worst;
  const along = Math.abs(axes[0].direction.reduce((sum, value, axis) => sum + value * camera_mm[axis], 0)) / Math.hypot(...camera_mm);
  const said = `${t('ellipsoid.axes', { a: mm(axes[0].length_mm), b: mm(axes[1].length_mm), c: mm(axes[2].length_mm) })} ${t(along > 0.7 ? 'ellipsoid.along' : 'ellipsoid.across')} ${t('ellipsoid.times', { times: count(found.times) })}`;
  return html`<${CanvasScene} create=${create} show=${(scene, dark) => scene.show(found.shown, found.times, dark)} shown=${found} said=${said} alt=${t('ellipsoid.alt')} />`;
}
