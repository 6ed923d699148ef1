// Texts by id and parameters in the chosen language; what is missing there is shown in English.
import { effect, signal } from '../vendor/preact.js';
import { fill, pseudo } from '../words/fill.js';
import { LANGUAGES, language } from './choices.js';

const en = await texts('en');
const dictionary = signal({ tag: 'en', page: en, daemon: {} });

/** Ends when the texts in the language chosen at first are there, or cannot be fetched. */
export let spoken = Promise.resolve();

effect(() => {
  spoken = load(language.value).catch(() => {});
});

/** The texts of words/`name`.json by id. Throws when they do not come. */
async function texts(name) {
  const response = await fetch(new URL(`../words/${name}.json`, import.meta.url));
  if (!response.ok) throw new Error(`no words of ${name}: ${response.status}`);
  return response.json();
}

async function load(tag) {
  if (tag === 'pseudo') {
    show({ tag, page: Object.fromEntries(Object.entries(en).map(([id, text]) => [id, pseudo(text)])), daemon: {} });
  } else if (tag === 'en') {
    show({ tag, page: en, daemon: {} });
  } else if (['de', 'zh', 'es'].includes(tag)) {
    const [page, sections, errors] = await Promise.all([texts(tag), texts(`sentences.${tag}`), texts(`errors.${tag}`)]);
    if (language.value === tag) show({ tag, page, daemon: Object.assign({}, ...Object.values(sections), errors) });
  }
}

function show(loaded) {
  dictionary.value = loaded;
  document.documentElement.lang = { zh: 'zh-Hans', pseudo: 'en-x-pseudo' }[loaded.tag] ?? loaded.tag;
}

/** The page's text `id`, with {name} filled from `params`. */
export function t(id, params = {}) {
  return fill(dictionary.value.page[id] ?? en[id] ?? id, params);
}

export const has = (id) => id in en;

/** A device's name in words; one that is not known to the page stays as the daemon gives it. */
export const deviceName = (name) => (has(`device.name.${name}`) ? t(`device.name.${name}`) : name);

/** The address of a report in the chosen language. */
export const reportAt = (path) => `${path}?language=${language.value in LANGUAGES ? language.value : 'en'}`;

/** The locale of numbers and dates. */
export function locale() {
  const { tag } = dictionary.value;
  return { en: 'en-GB', zh: 'zh-CN', pseudo: 'en-GB' }[tag] ?? tag;
}

/** What parts the whole from its fraction in the chosen language. */
const decimalMark = () => new Intl.NumberFormat(locale()).format(0.5)[1];

/** A sentence of the daemon, { id, params, message }, as { text, lang }: lang is set when it had to stay English. */
export function sentence({ id, params = {}, message }) {
  const { tag, daemon } = dictionary.value;
  if (tag === 'pseudo') return { text: pseudo(message ?? ''), lang: undefined };
  const text = id in daemon && id !== 'as-written' && translated(daemon, id, params);
  return text ? { text, lang: undefined } : { text: message ?? '', lang: tag === 'en' ? undefined : 'en' };
}

function translated(table, id, params) {
  try {
    return fill(table[id], inWords(params), table, decimalMark());
  } catch {
    return null; // a part of it has no translation yet
  }
}

const VOLUME = ['near', 'middle', 'far', 'top', 'bottom', 'left', 'right'];

/** The name of a point of the working volume in this language; null of a user's own. */
export function volumePoint(name) {
  const parts = String(name).split(' ');
  return parts.length === 3 && parts.every((part) => VOLUME.includes(part)) ? parts.map((part) => t(`volume.${part}`)).join(' ') : null;
}

/** `params` with `point` in words, also of the sentences among them. */
const inWords = (params) => Object.fromEntries(Object.entries(params).map(([name, value]) => [
  name, name === 'point' ? (volumePoint(value) ?? value) : value?.params ? { ...value, params: inWords(value.params) } : value,
]));

/** The texts `messages` in words, by their `details` { id, params } where the daemon gives them. */
export const sentences = (messages, details = []) => messages.map((message, index) => sentence({ ...details[index], message }));

/** Whether every part of a sentence { id, params } is in the table: none is the text of a device or a library. */
const isWhole = ({ id, params = {} }) => id in dictionary.value.daemon && id !== 'as-written' && Object.values(params).flat().every((part) => !part?.id || isWhole(part));

/** A refusal or cause { code, what, fix } as { what, fix, detail }: in another language its sentences by `details`, else what its code means, and the English detail. */
export function causeWords({ id, code, params, what, fix, details = {} }) {
  const made = (part, message) => (details[part] && isWhole(details[part]) ? sentence({ ...details[part], message }) : null);
  const whole = made('what', what);
  const said = whole ?? sentence({ id: id ?? `${code}.what`, params, message: what });
  return { what: said, fix: made('fix', fix) ?? sentence({ id: `${code}.fix`, message: fix }), detail: whole || said.text === what ? null : what };
}

/** What a code of GET /help means, as { text, lang }: … for what only a case of it knows. */
export function meaning({ code, kind, what = '' }) {
  const { text, lang } = sentence({ id: kind === 'error' ? `${code}.what` : code, message: what });
  return { text: text.replace(/\{[^}]*\}/g, '…'), lang };
}
