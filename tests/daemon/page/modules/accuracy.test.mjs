// U of one calibration has the same digits in Cell, Run and Result (`Uncertainty`) and in History.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';
import test from 'node:test';

const page = join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page');
const nothing = () => {};
const stored = { getItem: () => null, setItem: nothing };
const element = { lang: '', dataset: {}, style: { setProperty: nothing }, setAttribute: nothing, classList: { toggle: nothing } };
const browser = {
  document: { documentElement: element, addEventListener: nothing, createElement: () => element, head: element, querySelector: () => element },
  localStorage: stored, sessionStorage: stored, addEventListener: nothing, location: { search: '', hash: '', href: 'http://cell/page/' },
  navigator: { languages: ['en'], language: 'en' }, BroadcastChannel: class { postMessage = nothing; },
  matchMedia: () => ({ matches: false, addEventListener: nothing }), history: { replaceState: nothing },
  fetch: async (address) => new Response(await readFile(address)),
};
for (const [name, value] of Object.entries(browser)) Object.defineProperty(globalThis, name, { value, configurable: true, writable: true });
const { Uncertainty } = await import(join(page, 'parts', 'in_force.js'));
const { rowsOf } = await import(join(page, 'screens', 'history.js'));

const ACCURACY = {
  expanded_mm: 0.2345, worst_point: 'far top left', tolerance_mm: 1, tolerance_stated: false, expected_mm: 0.1234, before_mm: 0.5678,
  why: { id: 'accuracy-unexpected', params: {}, message: 'U is 0.23 mm, and 0.12 mm was expected: the corners scatter' },
};

/** The text of a tree of elements. */
function textOf(node) {
  if (node === null || node === undefined || typeof node === 'boolean') return '';
  if (Array.isArray(node)) return node.map(textOf).join(' ');
  if (typeof node !== 'object') return String(node);
  return typeof node.type === 'function' ? textOf(node.type(node.props)) : textOf(node.props.children);
}

test('an accuracy is shown with what it is judged by', () => {
  const text = textOf(Uncertainty({ accuracy: ACCURACY }));
  for (const part of ['± 0.23 mm', 'far top left', '± 1.0 mm · not stated by you', '± 0.12 mm', 'Active at the time', '± 0.57 mm', ACCURACY.why.message]) assert.ok(text.includes(part), `${part}: ${text}`);
});

test('a tolerance that was stated is not said to be otherwise', () => {
  assert.ok(!textOf(Uncertainty({ accuracy: { ...ACCURACY, tolerance_stated: true } })).includes('not stated'));
});

test('nothing is invented of a calibration without points', () => {
  const unknown = Object.fromEntries(Object.keys(ACCURACY).map((name) => [name, null]));
  assert.ok(textOf(Uncertainty({ accuracy: unknown })).startsWith('—'));
});

test('History shows the digits of Result', () => {
  const listed = { ...ACCURACY, id: 'c', created_at: '2026-11-21T09:00:00Z', accepted: true, current: true };
  const [row] = rowsOf([], { calibrations: [listed], applied: [] }, []);
  assert.ok(textOf(row.words).includes('± 0.23 mm'), textOf(row.words));
});
