// Numbers as people read them: two significant digits of an uncertainty, a unit always, U+2212 for minus.
import { locale } from './words.js';

const made = new Map(); // formats by language and options: one takes a tenth of a millisecond to make

/** The `Kind` of Intl for the language in use. */
function formatOf(Kind, options) {
  const key = `${Kind.name} ${locale()} ${JSON.stringify(options)}`;
  if (!made.has(key)) made.set(key, new Kind(locale(), options));
  return made.get(key);
}

const plain = (value, options) => formatOf(Intl.NumberFormat, options).format(value).replace('-', '−');

/** A length with `digits` significant ones: "0.13 mm". "—" for none. */
export function mm(value, digits = 2) {
  return value === null || value === undefined ? '—' : `${significant(value, digits)} mm`;
}

export function deg(value, digits = 2) {
  return value === null || value === undefined ? '—' : `${significant(value, digits)}°`;
}

export function significant(value, digits = 2) {
  if (!Number.isFinite(value)) return '—';
  const places = value === 0 ? 0 : Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(value))));
  return fixed(value, Math.min(places, 6));
}

export function fixed(value, places) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '—';
  return plain(value, { minimumFractionDigits: places, maximumFractionDigits: places, useGrouping: false });
}

/** A number with its sign: "+60", "−501". */
export const signed = (value, places = 0) => plain(value, { maximumFractionDigits: places, signDisplay: 'exceptZero' });

const commaIsDecimal = () => plain(0.5, {}).includes(',');

/** Numbers of one vector in brackets, parted so that a decimal comma is not taken for the next one. */
export const vector = (values, places) => `(${values.map((value) => fixed(value, places)).join(commaIsDecimal() ? '; ' : ', ')})`;

/** Numbers in a row, as `vector` without brackets. */
export const inRow = (texts) => texts.join(commaIsDecimal() ? '; ' : ', ');

export const count = (value) => plain(value, {});

/** A large number in three significant digits: "12.3m", "1230万". */
export const about = (value) => plain(value, { notation: 'compact', maximumSignificantDigits: 3 });

export function bytes(value) {
  if (value === null || value === undefined) return '—';
  const [unit, name] = value < 1e6 ? [1e3, 'kB'] : value < 1e9 ? [1e6, 'MB'] : [1e9, 'GB'];
  return `${significant(value / unit, 2)} ${name}`;
}

const asDate = (text) => (text ? new Date(text) : null);

/** Day and time of an ISO text. */
export function moment(text) {
  const date = asDate(text);
  if (!date || Number.isNaN(date.getTime())) return '—';
  return formatOf(Intl.DateTimeFormat, { dateStyle: 'medium', timeStyle: 'short' }).format(date);
}

export function timeOfDay(text) {
  const date = asDate(text);
  if (!date || Number.isNaN(date.getTime())) return '—';
  return formatOf(Intl.DateTimeFormat, { timeStyle: 'short' }).format(date);
}
