// What the page shows of one picture: `node numbers_of_a_picture.mjs JSON`, with { index, run, said }; prints { place: text }.
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';

const page = join(import.meta.dirname, '..', '..', '..', 'daemon', 'page');
const nothing = () => {};
const browser = {
  document: { documentElement: { lang: '', dataset: {} }, addEventListener: nothing }, addEventListener: nothing,
  localStorage: { getItem: () => null, setItem: nothing }, matchMedia: () => ({ matches: false, addEventListener: nothing }),
  location: { search: '', hash: '', href: 'http://cell/page/', pathname: '/page/' }, navigator: { languages: ['en'], language: 'en' },
  fetch: async (address) => new Response(await readFile(address)),
};
for (const [name, value] of Object.entries(browser)) Object.defineProperty(globalThis, name, { value, configurable: true, writable: true });

/** The texts in what a component draws, without those of components within. */
const textsOf = (drawn) => [drawn].flat(Infinity).flatMap((part) => (typeof part?.type === 'string' ? textsOf(part.props.children) : ['string', 'number'].includes(typeof part) ? [String(part)] : []));

const { index, run, said } = JSON.parse(process.argv[2]);
const { spoken } = await import(join(page, 'state', 'words.js'));
await spoken;
const { Film } = await import(join(page, 'parts', 'film.js'));
const { ViewTable } = await import(join(page, 'parts', 'view_table.js'));
const { sentenceOf } = await import(join(page, 'screens', 'run.js'));
const { fill } = await import(join(page, 'words', 'fill.js'));
const rows = [{ index, corners: [] }];
const shown = { film: textsOf(Film({ shown: { ...run, over: true }, rows })).join(' '), table: textsOf(ViewTable({ rows, choose: nothing })).join(' '), progress: sentenceOf(run) };
for (const tag of ['de', 'es', 'zh']) {
  const sections = JSON.parse(await readFile(join(page, '..', '..', 'calibration', 'sentences', 'words', `${tag}.json`)));
  const table = Object.assign({}, ...Object.values(sections));
  said.forEach(({ id, params }, at) => { shown[`sentence ${at}, ${tag}`] = fill(table[id], params, table); });
}
console.log(JSON.stringify(shown));
process.exit(0);
