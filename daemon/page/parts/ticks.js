// Round numbers for the axes of a chart (pure).

/** At most `most` round numbers from `low` to `high`; whole ones if `whole`. */
export function ticks(low, high, most, whole = false) {
  const span = high - low;
  if (!(span > 0)) return [low];
  let step = 10 ** Math.floor(Math.log10(span / most));
  for (const factor of [1, 2, 5, 10]) {
    if (span / (step * factor) <= most) {
      step *= factor;
      break;
    }
  }
  if (whole) step = Math.max(1, Math.round(step));
  const found = [];
  for (let at = Math.ceil(low / step - 1e-9) * step; at <= high + step * 1e-9; at += step) found.push(Number(at.toPrecision(10)));
  return found;
}

/** 1, 2, 5 times powers of ten within [low, high]; powers of ten only when these are many. */
export function logTicks(low, high) {
  const found = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1) {
    for (const factor of [1, 2, 5]) {
      const at = Number((factor * 10 ** power).toPrecision(6));
      if (at >= low && at <= high) found.push(at);
    }
  }
  return found.length > 7 ? found.filter((at) => Number.isInteger(Math.round(Math.log10(at) * 1e6) / 1e6)) : found;
}
