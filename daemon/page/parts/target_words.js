// A target in the words of the command line: taken apart, put together, and the command that prints it (pure).

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
  const second = { charuco: ':0.75', 'apriltag-grid': ':0.25', 'aruco-grid': ':0.25' }[kind] ?? '';
  return [`${kind}:${columns}x${rows}:1${second}`, ...rest.trim().split(/\s+/).filter(Boolean)].join(':');
}

const MEASURES = { // options of `handeyed target` for the one length and the other, which is so much of the first while nobody measured it
  chessboard: ['pitch-mm'], circles: ['pitch-mm'], charuco: ['square-mm', 'marker-mm', 0.75], 'apriltag-grid': ['tag-mm', 'gap-mm', 0.25],
  'aruco-grid': ['marker-mm', 'gap-mm', 0.25], 'aruco-marker': ['marker-mm'],
};
const USUAL_MM = 20;
const MARGINS = { chessboard: 3, circles: 1.5 }; // beside its counted places, in pitches
const PAGES_MM = { A4: [210, 297], A3: [297, 420], A2: [420, 594], A1: [594, 841], A0: [841, 1189] };
const KEPT_MM = [21, 40]; // of a page, for margins, rulers and words

/** The smallest page that holds a target of this width and height in mm, upright or turned. */
function pageOf(width, height) {
  const holds = ([page, other]) => width <= page - KEPT_MM[0] && height <= other - KEPT_MM[1];
  return Object.keys(PAGES_MM).find((name) => holds(PAGES_MM[name]) || holds([...PAGES_MM[name]].reverse())) ?? 'A0';
}

/** The command that writes the target `text` to print, its lengths in mm, NaN where they are not known (pure). */
export function printCommand(text, length_mm, second_mm) {
  const { kind: named, columns, rows, rest } = partsOfTarget(text);
  const [kind, layout] = named.startsWith('circles-') ? named.split('-') : [named];
  const [first, second, share] = MEASURES[kind] ?? [];
  const length = length_mm > 0 ? length_mm : USUAL_MM;
  const other = second_mm > 0 ? second_mm : share * length;
  const pitch = kind.endsWith('-grid') ? length + other : length;
  const [width, height] = [columns, rows].map((count) => (Number(count || 1) + (MARGINS[kind] ?? 1)) * pitch);
  const [marks, id] = rest.split(' ');
  const options = {
    layout, columns, rows, [first]: length, [second]: other,
    [kind === 'apriltag-grid' ? 'family' : 'dictionary']: kind in { charuco: 1, 'apriltag-grid': 1, 'aruco-grid': 1, 'aruco-marker': 1 } ? marks : '', id: kind === 'aruco-marker' ? id : '',
  };
  const words = Object.entries(options).filter(([name, value]) => name !== 'undefined' && value).map(([name, value]) => `--${name} ${typeof value === 'number' ? Number(value.toFixed(3)) : value}`);
  return ['handeyed target', kind, ...words, `--page ${pageOf(width, height)}`, '-o target.pdf'].join(' ');
}
