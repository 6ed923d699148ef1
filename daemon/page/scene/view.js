// A canvas with three.js: camera, light, drawing on demand, keys. Everything is in the robot's base, mm, z up.
import { DirectionalLight, HemisphereLight, OrbitControls, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from '../vendor/three.js';
import { idle } from '../state/idle.js';
import { createFlatView } from './flat_view.js';
import { graphicsStarted } from './graphics.js';

const STEP_RAD = 0.12;
const COMPILE_MS = 20; // between two looks whether the shaders are compiled

/**
 * Draws `scene` on `canvas` whenever `draw` is called; arrows turn, + and − come nearer, Home goes back. Three flat pictures without
 * WebGL 2; null when three.js cannot draw. Made in steps, each while the page has nothing else to do.
 */
export async function createView(canvas, { from = [2600, -2200, 1700], at = [500, 0, 500], onDraw } = {}) {
  await graphicsStarted();
  await idle();
  const ratio = Math.min(devicePixelRatio, 2);
  Object.assign(canvas, { width: canvas.clientWidth * ratio, height: canvas.clientHeight * ratio }); // before: a buffer is made once
  const context = canvas.getContext('webgl2', { alpha: true, antialias: true, stencil: false });
  if (!context) return createFlatView(canvas, { onDraw });
  await idle();
  let renderer;
  try {
    renderer = new WebGLRenderer({ canvas, context });
  } catch {
    return null; // a canvas with a context of WebGL, even a lost one, gives none for flat pictures
  }
  renderer.setPixelRatio(ratio);
  await idle();
  const scene = new Scene();
  const camera = new PerspectiveCamera(38, 1.6, 5, 60000);
  camera.up.set(0, 0, 1);
  const controls = new OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.zoomSpeed = 1.4;
  scene.add(new HemisphereLight(0xffffff, 0x8a9299, 3.2));
  const sun = new DirectionalLight(0xffffff, 2.2);
  sun.position.set(1500, -2500, 4000);
  scene.add(sun);

  let wanted = 0;
  let compiling = 0;
  const draw = () => {
    wanted ||= requestAnimationFrame(() => {
      wanted = 0;
      if (compiling) return;
      renderer.render(scene, camera);
      onDraw?.();
    });
  };
  /** Draw what was added once its shaders are compiled, which happens beside the page; drawn at once, it would wait for them. */
  const drawAdded = () => {
    const materials = [...renderer.compile(scene, camera)];
    clearTimeout(compiling);
    const wait = () => {
      compiling = materials.every((material) => renderer.properties.get(material).currentProgram?.isReady() ?? true) ? 0 : setTimeout(wait, COMPILE_MS);
      if (!compiling) draw();
    };
    wait();
  };
  const home = { from: new Vector3(...from), at: new Vector3(...at) };
  const goHome = () => {
    camera.position.copy(home.from);
    controls.target.copy(home.at);
    controls.update();
    draw();
  };
  controls.addEventListener('change', draw);

  const turn = (azimuth, height) => {
    const way = camera.position.clone().sub(controls.target);
    way.applyAxisAngle(camera.up, azimuth);
    const side = new Vector3().crossVectors(camera.up, way).normalize();
    const raised = way.clone().applyAxisAngle(side, height);
    if (Math.abs(raised.clone().normalize().z) < 0.995) way.copy(raised);
    camera.position.copy(controls.target).add(way);
    controls.update();
  };
  const zoom = (factor) => {
    camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
    controls.update();
  };
  const acts = {
    ArrowLeft: () => turn(-STEP_RAD, 0), ArrowRight: () => turn(STEP_RAD, 0), ArrowUp: () => turn(0, -STEP_RAD),
    ArrowDown: () => turn(0, STEP_RAD), '+': () => zoom(0.85), '-': () => zoom(1 / 0.85), Home: goHome,
  };
  const onKey = (event) => {
    if (!(event.key in acts)) return;
    event.preventDefault();
    acts[event.key]();
  };
  canvas.addEventListener('keydown', onKey);
  const sizes = new ResizeObserver(() => {
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !height) return;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    draw();
  });
  sizes.observe(canvas);
  goHome();
  return {
    scene, camera, controls, renderer, draw, drawAdded,
    /** Look at the box of these corners from the front, above; the whole box is in view. */
    frame(low, high, direction = [0.75, -1, 0.6]) {
      home.at.set(...low.map((value, axis) => (value + high[axis]) / 2));
      const back = new Vector3(...direction).normalize();
      const right = new Vector3().crossVectors(camera.up, back).normalize();
      const up = new Vector3().crossVectors(back, right);
      const slope = Math.tan((camera.fov * Math.PI) / 360) * 0.96;
      const distances = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => {
        const corner = new Vector3(...[0, 1, 2].map((axis) => (bits & (1 << axis) ? high[axis] : low[axis]))).sub(home.at);
        return corner.dot(back) + Math.max(Math.abs(corner.dot(up)), Math.abs(corner.dot(right)) / camera.aspect) / slope;
      });
      home.from.copy(back).multiplyScalar(Math.max(...distances)).add(home.at);
      goHome();
    },
    dispose() {
      clearTimeout(compiling);
      cancelAnimationFrame(wanted);
      sizes.disconnect();
      canvas.removeEventListener('keydown', onKey);
      controls.dispose();
      renderer.dispose();
    },
  };
}
