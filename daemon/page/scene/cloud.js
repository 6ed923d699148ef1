// A cloud in three dimensions: points coloured by source view, height, deviation or normal, clipped by height, picked by mouse, finger or key.
import { BufferAttribute, BufferGeometry, GLSL3, Points, Raycaster, ShaderMaterial, SphereGeometry, Mesh, MeshBasicMaterial, Vector2 } from '../vendor/three.js';
import { boundsOf, pickPoint } from './cloud_data.js';
import { createView } from './view.js';

const VERTEX = `
  in float view; in float deviation; in vec3 facing;
  uniform int colouring; uniform float low; uniform float high; uniform float cut; uniform float size; uniform float span;
  out vec3 shade;
  vec3 hue(float h) { vec3 k = abs(fract(h + vec3(0.0, 0.6667, 0.3333)) * 6.0 - 3.0) - 1.0; return mix(vec3(0.62), clamp(k, 0.0, 1.0), 0.62) * 0.92; }
  vec3 ramp(float s) { return vec3(0.16 + 0.79 * smoothstep(0.3, 1.0, s), 0.22 + 0.62 * s, 0.48 + 0.2 * sin(3.1416 * s) - 0.28 * smoothstep(0.6, 1.0, s)); }
  vec3 apart(float s) { return s < 0.0 ? mix(vec3(0.93), vec3(0.08, 0.30, 0.65), -s) : mix(vec3(0.93), vec3(0.75, 0.18, 0.05), s); }
  void main() {
    if (colouring == 0) shade = hue(view * 0.381966);
    else if (colouring == 1) shade = ramp(clamp((position.z - low) / max(1e-3, high - low), 0.0, 1.0));
    else if (colouring == 2) shade = deviation > 1e8 ? vec3(0.55) : apart(clamp(deviation / span, -1.0, 1.0));
    else shade = 0.5 + 0.5 * facing;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    if (position.z > cut) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = size;
  }`;
const FRAGMENT = `in vec3 shade; out vec4 colour; void main() { colour = vec4(shade, 1.0); }`;

/** What VERTEX does, of one point: its colour in [r, g, b] to 255; null when it is cut off. */
export function shadeOf({ colouring, low, high, cut, span }, { position, view, deviation, facing }, index) {
  const z = position.getZ(index);
  if (z > cut.value) return null;
  const shades = [
    () => hue(view.getX(index) * 0.381966),
    () => ramp(Math.min(1, Math.max(0, (z - low.value) / Math.max(1e-3, high.value - low.value)))),
    () => apart(deviation.getX(index), span.value),
    () => [facing.getX(index), facing.getY(index), facing.getZ(index)].map((value) => 0.5 + 0.5 * value),
  ];
  return shades[colouring.value]().map((value) => Math.round(255 * Math.min(1, Math.max(0, value))));
}

const mix = (from, to, share) => from.map((value, channel) => value + share * (to[channel] - value));
const hue = (turn) => mix([0.62, 0.62, 0.62], [0, 2 / 3, 1 / 3].map((shift) => Math.min(1, Math.max(0, Math.abs(((turn + shift) % 1) * 6 - 3) - 1))), 0.62).map((value) => 0.92 * value);
const smooth = (from, to, value) => {
  const share = Math.min(1, Math.max(0, (value - from) / (to - from)));
  return share * share * (3 - 2 * share);
};
const ramp = (s) => [0.16 + 0.79 * smooth(0.3, 1, s), 0.22 + 0.62 * s, 0.48 + 0.2 * Math.sin(Math.PI * s) - 0.28 * smooth(0.6, 1, s)];
const apart = (deviation, span) => {
  if (deviation > 1e8) return [0.55, 0.55, 0.55];
  const s = Math.min(1, Math.max(-1, deviation / span));
  return mix([0.93, 0.93, 0.93], s < 0 ? [0.08, 0.3, 0.65] : [0.75, 0.18, 0.05], Math.abs(s));
};

const REST_MS = 700;
const UNKNOWN = 1e9; // a deviation that is not known: NaN does not pass every driver

/** Null where nothing can be drawn. `onPick({ point, view })` for a chosen point; `onRest({ middle, reach })` for what is looked at, mm. */
export async function createCloudScene(canvas, { onPick, onRest }) {
  const view = await createView(canvas);
  if (!view) return null;
  const material = new ShaderMaterial({
    vertexShader: VERTEX, fragmentShader: FRAGMENT, glslVersion: GLSL3,
    uniforms: { colouring: { value: 0 }, low: { value: 0 }, high: { value: 1 }, cut: { value: 1e9 }, size: { value: 2 }, span: { value: 1 } },
  });
  material.userData.shade = (attributes, index) => shadeOf(material.uniforms, attributes, index);
  let points = null;
  let detail = null;
  let data = null;
  const add = (cloud) => {
    const geometry = new BufferGeometry();
    const flat = (name, width) => cloud[name] ?? new Float32Array(width * cloud.points);
    const deviation = flat('deviation', 1).map((value) => (Number.isNaN(value) ? UNKNOWN : value));
    for (const [name, values, width] of [['position', cloud.xyz, 3], ['view', cloud.view, 1], ['deviation', deviation, 1], ['facing', flat('normal', 3), 3]]) {
      geometry.setAttribute(name, new BufferAttribute(values, width));
    }
    const added = new Points(geometry, material);
    added.frustumCulled = false;
    view.scene.add(added);
    return added;
  };
  const remove = (old) => {
    if (!old) return;
    view.scene.remove(old);
    old.geometry.dispose();
  };
  const marks = [];
  const mark = (place, size) => {
    const ball = new Mesh(new SphereGeometry(size, 16, 12), new MeshBasicMaterial({ color: 0xffffff }));
    ball.position.set(...place);
    view.scene.add(ball);
    marks.push(ball);
    if (marks.length > 2) view.scene.remove(marks.shift());
    view.draw();
  };
  const ray = new Raycaster();
  const pickAt = (x, y) => {
    if (!data || view.flat) return;
    ray.setFromCamera(new Vector2(x, y), view.camera);
    const index = pickPoint(data.xyz, ray.ray.origin.toArray(), ray.ray.direction.toArray(), 0.006);
    if (index < 0) return;
    const point = Array.from(data.xyz.subarray(3 * index, 3 * index + 3));
    mark(point, view.camera.position.distanceTo(view.controls.target) * 0.005);
    onPick({ point, view: data.view[index] });
  };
  let pressed = null;
  const onDown = (event) => (pressed = [event.clientX, event.clientY]);
  const onUp = (event) => {
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 6) return;
    const box = canvas.getBoundingClientRect();
    pickAt((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
  };
  let rest = 0;
  const onMove = () => {
    clearTimeout(rest);
    rest = setTimeout(() => {
      const { camera, controls } = view;
      const far = camera.position.distanceTo(controls.target);
      onRest({ middle: controls.target.toArray(), reach: far * Math.tan((camera.fov * Math.PI) / 360) * Math.max(1, camera.aspect) });
    }, REST_MS);
  };
  if (!view.flat) {
    view.controls.addEventListener('change', onMove);
    view.controls.zoomToCursor = true;
  }
  const onKey = ({ key }) => key === 'Enter' && pickAt(0, 0);
  canvas.addEventListener('pointerdown', onDown);
  canvas.addEventListener('pointerup', onUp);
  canvas.addEventListener('keydown', onKey);
  return {
    flat: view.flat,
    /** The cloud of `joinParts` or `joinSurfaces`; `keep`: the camera stays where it is. Returns the bounds. */
    show(cloud, keep) {
      data = cloud;
      remove(points);
      remove(detail);
      detail = null;
      points = add(cloud);
      const [low, high] = boundsOf(cloud.xyz);
      material.uniforms.low.value = low[2];
      material.uniforms.high.value = high[2];
      material.uniforms.size.value = cloud.points > 250_000 ? 1.6 : 3;
      if (!keep) view.frame(low, high, [0.35, -1, 0.45]);
      view.draw();
      return [low, high];
    },
    /** More points of the part that is looked at, drawn besides the others; null removes them. */
    showDetail(cloud) {
      remove(detail);
      detail = cloud && add(cloud);
      view.draw();
    },
    set(name, value) {
      material.uniforms[name].value = value;
      view.draw();
    },
    clear() {
      for (const ball of marks.splice(0)) view.scene.remove(ball);
      view.draw();
    },
    dispose() {
      canvas.removeEventListener('pointerdown', onDown);
      canvas.removeEventListener('pointerup', onUp);
      canvas.removeEventListener('keydown', onKey);
      clearTimeout(rest);
      remove(points);
      remove(detail);
      material.dispose();
      view.dispose();
    },
  };
}
