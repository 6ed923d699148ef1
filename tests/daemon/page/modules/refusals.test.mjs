// A refusal is said in the chosen language by the sentences it is made of, with its figures as that language writes them.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { basename, join } from 'node:path';
import test from 'node:test';

const root = join(import.meta.dirname, '..', '..', '..', '..');
const nothing = () => {};
const browser = {
  document: { documentElement: { lang: '', dataset: {} }, addEventListener: nothing },
  localStorage: { getItem: () => null, setItem: nothing }, addEventListener: nothing,
  location: { search: '', hash: '', href: 'http://cell/page/' }, navigator: { languages: ['de'], language: 'de' },
  matchMedia: () => ({ matches: false, addEventListener: nothing }),
  fetch: async (address) => {
    const [, tag] = /^sentences\.(\w+)\.json$/.exec(basename(address.pathname)) ?? [];
    return new Response(await readFile(tag ? join(root, 'calibration', 'sentences', 'words', `${tag}.json`) : address));
  },
};
for (const [name, value] of Object.entries(browser)) Object.defineProperty(globalThis, name, { value, configurable: true, writable: true });
const words = await import(join(root, 'daemon', 'page', 'state', 'words.js'));
await words.spoken;

const SAME_POSE = {
  code: 'same-pose', what: 'the arm stands where picture 1 was taken (0.30 mm from there)', fix: 'jog on, and turn the flange',
  details: { what: { id: 'stands-at-view', params: { number: 1, off_mm: 0.3 } }, fix: { id: 'jog-on-and-turn', params: {} } },
};

test('what and fix are said whole, with a decimal comma, and no English beside them', () => {
  assert.deepEqual(words.causeWords(SAME_POSE), {
    what: { text: 'der Arm steht, wo Aufnahme 1 gemacht wurde (0,30 mm davon entfernt)', lang: undefined },
    fix: { text: 'weiterfahren und den Flansch drehen', lang: undefined }, detail: null,
  });
});

test('why a run ended is said whole, with the picture after which it did', () => {
  const progress = { id: 'after-picture', params: { picture: 2, of: 5 } };
  const details = { what: { id: 'link-was-lost', params: { progress } }, fix: { id: 'look-at-stored', params: {} } };
  const said = words.causeWords({ code: 'link-lost', what: 'link to the controller lost after picture 2 of 5', fix: '', details });
  assert.deepEqual([said.what.text, said.detail], ['Verbindung zur Steuerung verloren, nach Aufnahme 2 von 5', null]);
});

test('without details, or with one that has no translation, the code says what it means and the English stands beside it', () => {
  const unknown = { what: { id: 'of-a-newer-daemon', params: {} }, fix: { id: 'as-written', params: { sentence: SAME_POSE.fix } } };
  const ofLibrary = { what: { id: 'ended-at', params: { what: unknown.fix, progress: { id: 'after-picture', params: { picture: 2, of: 5 } } } }, fix: unknown.fix };
  for (const details of [undefined, unknown, ofLibrary]) {
    const said = words.causeWords({ ...SAME_POSE, details });
    assert.equal(said.detail, SAME_POSE.what);
    assert.notEqual(said.what.text, SAME_POSE.what);
    assert.notEqual(said.fix.text, SAME_POSE.fix);
  }
});

test('a point of the working volume is named in the language, also within a sentence, and one of a user stays', () => {
  const at = (point) => ({ id: 'compared-at-points', params: { apart: { id: 'compared-apart', params: { translation_mm: 0.1, rotation_deg: 0.01 } }, point, difference_mm: 0.137 } });
  const said = words.sentence({ id: 'compared-agree', params: { apart: at('far bottom right'), mahalanobis: 2.3, percent: 53 } }).text;
  assert.ok(said.includes('bei fern unten rechts 0,137 mm'), said);
  for (const own of ['far weld seam', 'top', 'Bohrung 3']) assert.ok(words.sentence(at(own)).text.includes(`bei ${own} 0,137 mm`));
});

test('the help says what a code means in the language, without the places of a template', () => {
  const better = { code: 'better-poses', kind: 'finding', what: '{poses} planned poses would leave U = {planned_mm:.2g} mm' };
  assert.match(words.meaning(better).text, /^… geplante Posen .*U = … mm/);
  assert.deepEqual(words.meaning({ code: 'of-a-newer-daemon', kind: 'error', what: 'Something with `holders` {n:g}.' }), { text: 'Something with `holders` ….', lang: 'en' });
  assert.equal(words.meaning({ code: 'abort-held', kind: 'error', what: 'A PLC holds abort.' }).lang, undefined);
});
