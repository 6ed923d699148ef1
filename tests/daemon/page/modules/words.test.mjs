// Templates are filled as the daemon fills its own.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';

const page = join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page');
const { fill, pseudo } = await import(join(page, 'words', 'fill.js'));
const places = (text) => [...text.matchAll(/\{(\w+)[^}]*\}/g)].map(([, name]) => name).sort().join();

test('forms are those of the daemon', () => {
  const rows = [
    ['{a:.2g} mm', { a: 0.12345 }, '0.12 mm'], ['{a:.1f}', { a: 2 }, '2.0'], ['{a:+.2f}', { a: -1.5 }, '−1.50'], ['{a:.0%}', { a: 0.25 }, '25 %'],
    ['{a:views}', { a: [1, 2] }, '2, 3'], ['{a:picture}', { a: 0 }, '1'], ['{a:picture}', { a: [0, 11] }, '1, 12'], ['{a:picture}', { a: '—' }, '—'], ['{a: and }', { a: ['x', 'y'] }, 'x and y'], ['{a:g}', { a: 4 }, '4'], ['{b}', {}, '{b}'],
  ];
  for (const [template, params, expected] of rows) assert.equal(fill(template, params), expected);
});

test('numbers of the daemon have the decimal mark of the language, and are not run together', () => {
  const table = { part: '{x:.1f} mm' };
  assert.equal(fill('{a:.2g} mm, {b}', { a: -0.125, b: { id: 'part', params: { x: 2 } } }, table, ','), '−0,13 mm, 2,0 mm');
  assert.equal(fill('({a})', { a: [0.5, 1, -2.25] }, {}, ','), '(0,5; 1; −2,25)');
  assert.equal(fill('{a}', { a: [1, 2] }, {}, ','), '1, 2');
  assert.equal(fill('{a}', { a: '1.5.2' }, {}, ','), '1.5.2');
});

test('a part without a text is noticed', () => {
  assert.equal(fill('{a}', { a: { id: 'x', params: { n: 1 } } }, { x: '<{n}>' }), '<1>');
  assert.throws(() => fill('{a}', { a: { id: 'y', params: {} } }, {}));
});

test('the pseudo-language is 40 % longer and keeps its places', () => {
  const text = pseudo('Flange at {x}, in the base.');
  assert.ok(text.length >= 1.4 * 24);
  assert.equal(places(text), 'x');
});
