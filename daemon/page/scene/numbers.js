// The numbers of pictures over a scene, in their order, and the path between them: taken, the next, planned.
const SVG = 'http://www.w3.org/2000/svg';
export const APART_PX = 24;
const RADIUS_PX = 10;
const ROUNDS = 60;

const COLOURS = {
  light: { ink: '#1b1f23', next: '#0a5299', paper: '#f9fafb' },
  dark: { ink: '#eef1f3', next: '#93c5ff', paper: '#1e2327' },
};

/** Spots [x, y] moved no more than needed until no two are nearer than APART_PX. */
export function movedApart(spots) {
  const moved = spots.map(([x, y]) => [x, y]);
  for (let round = 0; round < ROUNDS; round += 1) {
    let near = false;
    for (let i = 0; i < moved.length; i += 1) {
      for (let j = 0; j < i; j += 1) {
        const [dx, dy] = [moved[i][0] - moved[j][0], moved[i][1] - moved[j][1]];
        const distance = Math.hypot(dx, dy);
        if (distance >= APART_PX - 0.01) continue;
        near = true;
        const [ux, uy] = distance > 1e-6 ? [dx / distance, dy / distance] : [Math.cos(i), Math.sin(i)];
        const half = (APART_PX - distance) / 2;
        moved[i] = [moved[i][0] + ux * half, moved[i][1] + uy * half];
        moved[j] = [moved[j][0] - ux * half, moved[j][1] - uy * half];
      }
    }
    if (!near) break;
  }
  return moved;
}

/** Poses in the order of a run: [{ state, at }], `at` in mm in the base. */
export function inOrder({ taken = [], next = null, planned = [] }) {
  const of = (state) => ({ translation_mm: at }) => ({ state, at });
  return [...taken.map(of('taken')), ...(next ? [next] : []).map(of('next')), ...planned.map(of('planned'))];
}

function made(name, attributes, text) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

/** Numbers over `canvas`; `project`: a point in the base to -1 to 1 across and up the picture, z above 1 where it is not in view. `place` them after each drawing. */
export function createNumbers(canvas, project) {
  const svg = made('svg', { class: 'numbers', 'aria-hidden': 'true' });
  Object.assign(svg.style, { position: 'absolute', inset: '0', width: '100%', height: '100%', pointerEvents: 'none' });
  canvas.after(svg);
  let poses = [];
  let colour = COLOURS.light;
  const place = () => {
    const { clientWidth: width, clientHeight: height } = canvas;
    svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
    const seen = poses.map(({ state, at }, index) => ({ state, number: index + 1, point: project(at) })).filter(({ point }) => Math.abs(point.z) <= 1);
    const spots = seen.map(({ point }) => [((point.x + 1) * width) / 2, ((1 - point.y) * height) / 2]);
    const lines = seen.slice(1).map(({ state }, index) => made('line', {
      x1: spots[index][0], y1: spots[index][1], x2: spots[index + 1][0], y2: spots[index + 1][1],
      stroke: state === 'taken' ? colour.ink : colour.next, 'stroke-width': state === 'next' ? 2.5 : 1.5, ...(state === 'planned' && { 'stroke-dasharray': '5 5' }),
    }));
    const marks = movedApart(spots).flatMap(([x, y], index) => {
      const { state, number } = seen[index];
      const fill = { taken: colour.ink, next: colour.next, planned: colour.paper }[state];
      return [
        made('circle', { cx: x, cy: y, r: RADIUS_PX, fill, stroke: state === 'planned' ? colour.next : colour.paper, 'stroke-width': 1.5 }),
        made('text', { x, y: y + 4.5, 'text-anchor': 'middle', 'font-size': 12, 'font-weight': 700, fill: state === 'planned' ? colour.next : colour.paper }, number),
      ];
    });
    svg.replaceChildren(...lines, ...marks);
  };
  return {
    place,
    show(order, dark) {
      poses = inOrder(order);
      colour = dark ? COLOURS.dark : COLOURS.light;
      place();
    },
    dispose: () => svg.remove(),
  };
}
