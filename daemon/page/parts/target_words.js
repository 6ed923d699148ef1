// A target in the words of the command line: taken apart, put together, and where it is printed (pure).

/** A target in the words of `handeyed import --target`, taken apart (pure): { kind, columns, rows, rest }. */
export function partsOfTarget(text) {
  const [kind = '', ...parts] = text.split(':');
  const size = /^(\d+)x(\d+)$/.exec(parts[0] ?? '');
  const lengths = kind === 'chessboard' || kind.startsWith('circles') || kind === 'aruco-marker' ? 1 : 2;
  return { kind, columns: size?.[1] ?? '', rows: size?.[2] ?? '', rest: parts.slice((size ? 1 : 0) + lengths).join(' ') };
}

/** The words of a target that a person described (pure). */
export function textOfTarget({ kind, columns, rows, rest }) {
  if (kind === 'aruco-marker') return `${kind}:1:${rest.trim().split(/\s+/).join(':')}`;
  return [`${kind}:${columns}x${rows}:1`, ...(SHARES[kind] ? [SHARES[kind]] : []), ...rest.trim().split(/\s+/).filter(Boolean)].join(':');
}

/** Whether both are of one kind, with the same counts and marks, whatever their lengths (pure). */
export const sameTarget = (one, other) => JSON.stringify(partsOfTarget(one)) === JSON.stringify(partsOfTarget(other));

/** The answer `200/10 15 calliper` taken apart (pure); what is usual for an empty one. */
export function sizeOf(text) {
  const [, length, count, second, instrument] = /^([\d.,]+)(?:\/(\d+))?(?:\s+([\d.,]+))?(?:\s+([a-z].*))?$/.exec(text) ?? [];
  return length ? { length, count: count ?? '1', second: second ?? '', instrument: instrument ?? '' } : { length: '', count: '10', second: '', instrument: 'calliper' };
}

const SHARES = { charuco: 0.75, 'apriltag-grid': 0.25, 'aruco-grid': 0.25 }; // of the second length, where that in the picture is so near
const NEAR = 0.04;
const USUAL_MM = 20;

/** The address of the PDF that prints the target `text`, its lengths in mm, NaN where they are not known (pure). */
export function printAddress(text, length_mm, second_mm) {
  const parts = text.split(':');
  const at = /^\d+x\d+$/.test(parts[1]) ? 2 : 1;
  const share = SHARES[parts[0]];
  const seen = Number(parts[at + 1]) / Number(parts[at]);
  const length = length_mm > 0 ? length_mm : USUAL_MM;
  const second = second_mm > 0 ? second_mm : length * (Math.abs(seen - share) < NEAR * share ? share : seen);
  [length, ...(share ? [second] : [])].forEach((mm, index) => { parts[at + index] = String(Number(mm.toFixed(3))); });
  return `/setup/target.pdf?target=${encodeURIComponent(parts.join(':'))}`;
}
