// Three pictures of a scene on a canvas without WebGL: from the front, from above, from the side. The base, mm, z up.
import { Scene, Vector3 } from '../vendor/three.js';

const FILLED = 0.8; // of the picture: what is drawn may stand out of the box
const POINT_PX = 2;
const LIGHT = new Vector3(0.35, -0.6, 0.72); // towards it, of length 1

/** Axes across and up the picture, and the one along which it is looked; what has more of `sign` times that is nearer. */
export const SIDES = [
  { across: 0, up: 2, along: 1, sign: -1 },
  { across: 0, up: 1, along: 2, sign: 1 },
  { across: 1, up: 2, along: 0, sign: 1 },
];

/** As `createView`, but it cannot be turned: `flat` is true, there is no camera. Null without a canvas in two dimensions. */
export function createFlatView(canvas, { onDraw } = {}) {
  const context = canvas.getContext('2d');
  if (!context) return null;
  const scene = new Scene();
  let bounds = [[-500, -500, 0], [500, 500, 1000]];
  let wanted = 0;
  const draw = () => {
    wanted ||= requestAnimationFrame(() => {
      wanted = 0;
      paint(context, scene, bounds);
      onDraw?.();
    });
  };
  const sizes = new ResizeObserver(() => {
    const ratio = Math.min(devicePixelRatio, 2);
    canvas.width = canvas.clientWidth * ratio;
    canvas.height = canvas.clientHeight * ratio;
    draw();
  });
  sizes.observe(canvas);
  return {
    scene, draw, drawAdded: draw, flat: true,
    frame(low, high) {
      bounds = [low, high];
      draw();
    },
    dispose() {
      cancelAnimationFrame(wanted);
      sizes.disconnect();
    },
  };
}

function paint(context, scene, bounds) {
  const { width, height } = context.canvas;
  if (!width || !height) return;
  context.clearRect(0, 0, width, height);
  scene.updateMatrixWorld();
  const projections = projectionsOf(bounds, width, height);
  const parts = { Points: [], Mesh: [], LineSegments: [] };
  scene.traverseVisible((part) => parts[part.type in parts ? part.type : part.isLineSegments && 'LineSegments']?.push(part));
  if (parts.Points.length) context.putImageData(withPoints(context.createImageData(width, height), parts.Points, projections), 0, 0);
  SIDES.forEach((side, index) => {
    context.save();
    context.beginPath();
    context.rect((index * width) / 3, 0, width / 3, height);
    context.clip();
    fillFaces(context, parts.Mesh, side, projections[index]);
    for (const lines of parts.LineSegments) strokeLines(context, lines, projections[index]);
    context.restore();
  });
}

/** For each of SIDES a function from a point to [x, y] in pixels: the box of `bounds` fits into its third of the picture, at one scale in all. */
export function projectionsOf([low, high], width, height) {
  const extent = (axis) => Math.max(high[axis] - low[axis], 1e-6);
  const fitting = ({ across, up }) => FILLED * Math.min(width / 3 / extent(across), height / extent(up));
  const scale = Math.min(...SIDES.map(fitting));
  return SIDES.map(({ across, up }, index) => (point) => [
    ((index + 0.5) * width) / 3 + scale * (point[across] - (low[across] + high[across]) / 2),
    height / 2 - scale * (point[up] - (low[up] + high[up]) / 2),
  ]);
}

function pointsOf(part) {
  const position = part.geometry.getAttribute('position');
  const at = new Vector3();
  return Array.from({ length: position.count }, (_, index) => at.fromBufferAttribute(position, index).applyMatrix4(part.matrixWorld).toArray());
}

function strokeLines(context, part, project) {
  const points = pointsOf(part).map(project);
  const { material } = part;
  const painted = part.geometry.getAttribute('color');
  const colour = painted ? material.color.clone().setRGB(painted.getX(0), painted.getY(0), painted.getZ(0)) : material.color;
  context.strokeStyle = `#${colour.getHexString()}`;
  context.globalAlpha = material.opacity;
  context.setLineDash(material.isLineDashedMaterial ? [6, 4] : []);
  context.lineWidth = 1.5;
  context.beginPath();
  for (let index = 0; index + 1 < points.length; index += 2) {
    context.moveTo(...points[index]);
    context.lineTo(...points[index + 1]);
  }
  context.stroke();
  context.globalAlpha = 1;
}

/** Triangles from the farthest to the nearest, each as bright as it faces the light. */
function fillFaces(context, meshes, { along, sign }, project) {
  const faces = meshes.flatMap((mesh) => {
    const points = pointsOf(mesh);
    const order = mesh.geometry.index?.array ?? points.keys();
    const corners = Array.from(order, (index) => points[index]);
    const { material } = mesh;
    return Array.from({ length: corners.length / 3 }, (_, face) => {
      const three = corners.slice(3 * face, 3 * face + 3);
      return { three, nearness: sign * three.reduce((sum, corner) => sum + corner[along], 0), colour: shaded(material, three), opacity: material.opacity };
    });
  });
  faces.sort((a, b) => a.nearness - b.nearness);
  for (const { three, colour, opacity } of faces) {
    context.fillStyle = colour;
    context.globalAlpha = opacity;
    context.beginPath();
    three.forEach((corner) => context.lineTo(...project(corner)));
    context.fill();
  }
  context.globalAlpha = 1;
}

function shaded(material, three) {
  if (!material.isMeshLambertMaterial) return `#${material.color.getHexString()}`;
  const [a, b, c] = three.map((corner) => new Vector3(...corner));
  const facing = b.sub(a).cross(c.sub(a)).normalize().dot(LIGHT);
  return `#${material.color.clone().multiplyScalar(0.55 + 0.45 * Math.max(0, facing)).getHexString()}`;
}

/** The picture with the points of clouds, the nearest in front; `material.userData.shade(attributes, index)` is its [r, g, b] to 255, or null. */
function withPoints(picture, clouds, projections) {
  const { width, height, data } = picture;
  SIDES.forEach(({ along, sign }, index) => {
    const nearest = new Float32Array(width * height).fill(-Infinity);
    const [from, to] = [Math.ceil((index * width) / 3), Math.floor(((index + 1) * width) / 3) - POINT_PX];
    for (const { geometry: { attributes }, material } of clouds) {
      const { array, count } = attributes.position;
      for (let point = 0; point < count; point += 1) {
        const shade = material.userData.shade(attributes, point);
        if (!shade) continue;
        const place = [array[3 * point], array[3 * point + 1], array[3 * point + 2]];
        const [x, y] = projections[index](place).map(Math.round);
        if (x < from || x > to || y < 0 || y + POINT_PX > height) continue;
        const nearness = sign * place[along];
        for (let pixel = 0; pixel < POINT_PX ** 2; pixel += 1) {
          const at = (y + Math.floor(pixel / POINT_PX)) * width + x + (pixel % POINT_PX);
          if (nearness <= nearest[at]) continue;
          nearest[at] = nearness;
          data.set([...shade, 255], 4 * at);
        }
      }
    }
  });
  return picture;
}
