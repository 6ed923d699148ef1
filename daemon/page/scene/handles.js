// The faces of a box over a scene, each with a knob to drag along its axis. For the pointer alone: who has keys types the numbers.
const STEP_MM = 10;
const PROBE_MM = 100;

/** The value (mm) of a face dragged by `moved` px from `from_mm`, where PROBE_MM along its axis are `probe` px; in steps, and never past `other_mm`, the face opposite (pure). */
export function draggedTo(from_mm, moved, probe, other_mm) {
  const square = probe[0] ** 2 + probe[1] ** 2;
  if (square < 1) return from_mm; // one looks along the axis: no way of the pointer tells how far
  const value = Math.round((from_mm + (PROBE_MM * (moved[0] * probe[0] + moved[1] * probe[1])) / square) / STEP_MM) * STEP_MM;
  return from_mm > other_mm ? Math.max(value, other_mm + STEP_MM) : Math.min(value, other_mm - STEP_MM);
}

/** Knobs over `canvas`; `project`: as of `createNumbers`. `show(box_mm, dragged)`: `dragged(axis, end, mm)` is told where a face is drawn to. */
export function createHandles(canvas, project) {
  const layer = document.createElement('div');
  layer.className = 'handles';
  layer.setAttribute('aria-hidden', 'true');
  canvas.after(layer);
  let box_mm = null;
  let tell = null;
  let drag = null;
  const spot = (point) => {
    const { x, y, z } = project(point);
    return { at: [((x + 1) * canvas.clientWidth) / 2, ((1 - y) * canvas.clientHeight) / 2], seen: Math.abs(z) <= 1 };
  };
  const centre = (axis, end, beside = 0) => [0, 1, 2].map((each) => (each === axis ? box_mm[end][axis] + beside : (box_mm[0][each] + box_mm[1][each]) / 2));
  const knobs = [0, 1, 2].flatMap((axis) => [0, 1].map((end) => {
    const knob = document.createElement('span');
    knob.dataset.face = `${'XYZ'[axis]}${end + 1}`;
    knob.addEventListener('pointerdown', (event) => {
      if (event.button !== 0 || !event.isPrimary) return;
      event.preventDefault();
      knob.setPointerCapture(event.pointerId);
      const [here, there] = [spot(centre(axis, end)).at, spot(centre(axis, end, PROBE_MM)).at];
      drag = { from: [event.clientX, event.clientY], from_mm: box_mm[end][axis], other_mm: box_mm[1 - end][axis], probe: [there[0] - here[0], there[1] - here[1]] };
    });
    knob.addEventListener('pointermove', (event) => {
      if (!drag || !knob.hasPointerCapture(event.pointerId)) return;
      const value = draggedTo(drag.from_mm, [event.clientX - drag.from[0], event.clientY - drag.from[1]], drag.probe, drag.other_mm);
      if (value !== box_mm[end][axis]) tell(axis, end, value);
    });
    for (const kind of ['pointerup', 'pointercancel', 'lostpointercapture']) knob.addEventListener(kind, () => { drag = null; });
    layer.append(knob);
    return { knob, axis, end };
  }));
  const place = () => {
    layer.hidden = !box_mm || !tell;
    if (layer.hidden) return;
    for (const { knob, axis, end } of knobs) {
      const { at, seen } = spot(centre(axis, end));
      knob.hidden = !seen;
      Object.assign(knob.style, { left: `${at[0]}px`, top: `${at[1]}px` });
    }
  };
  return {
    place,
    dragging: () => drag !== null,
    show(box, dragged) {
      [box_mm, tell] = [box ?? null, dragged ?? null];
      place();
    },
    dispose: () => layer.remove(),
  };
}
