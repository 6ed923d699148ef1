// The body of POST /touch for one point, whose pose is read from the standing arm (pure).

/** Adds to `test` where there is one: tip, verification and tolerance are then those of that test. */
export function touchRequest({ test, tip, verification, id, tolerance_mm }) {
  const touches = [{ id }];
  if (test) return { adds_to: test.id, touches };
  return { tip, verification, touches, ...(tolerance_mm > 0 ? { tolerance_mm } : {}) };
}
