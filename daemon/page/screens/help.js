// Help: the page's rules in a few sentences, and every code with what it means and what to do.
import { html, useState } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Card } from '../parts/card.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { ask } from '../state/ask.js';
import { may } from '../state/now.js';
import { linkTo } from '../state/place.js';
import { causeWords, meaning, t } from '../state/words.js';

const RULES = ['hold', 'end', 'age', 'U', 'keys'];

export function Help({ argument }) {
  return html`<div class="grid">
    ${argument && html`<${Code} code=${argument} />`}
    <${Card} title=${t('help.title')} id="rules" wide="2"><dl class="rules">${RULES.map((name) => html`<div><dt>${t(`help.${name}`)}</dt><dd>${t(`help.${name}.about`)}</dd></div>`)}</dl></${Card}>
    ${may('admin') && html`<${Bundle} />`}
    <${Codes} />
  </div>`;
}

const KEPT_MS = 60_000; // until then the browser has taken what it downloads

function Bundle() {
  const [pictures, setPictures] = useState(false);
  const download = async () => {
    const { data } = await ask('/support-bundle', { method: 'POST', body: { pictures }, headers: { Accept: 'application/gzip' }, kind: 'blob', limit_s: 120 });
    const link = document.createElement('a');
    link.href = URL.createObjectURL(data);
    link.download = `handeyed-support-${new Date().toISOString().slice(0, 19).replace(/[-:]/g, '').replace('T', '-')}.tar.gz`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), KEPT_MS);
  };
  return html`<${Card} title=${t('help.bundle')} id="bundle"><p>${t('help.bundle.about')}</p>
    <label class="check"><input type="checkbox" checked=${pictures} onChange=${() => setPictures(!pictures)} /><span>${t('help.bundle.pictures')}</span></label>
    <${Act} label=${t('download')} act=${download} /></${Card}>`;
}

function Code({ code }) {
  const found = useAsked(`/help/${encodeURIComponent(code)}`);
  return html`<${Card} title=${code} id="code" wide="3"><${Missing} asked=${found} none=${t('help.unknown')} />
    ${found.data && html`<${Entry} entry=${found.data} />`}</${Card}>`;
}

const Entry = ({ entry }) => {
  const { fix, detail } = causeWords(entry), what = meaning(entry);
  return html`<p lang=${what.lang}>${what.text}</p>${detail && html`<p class="small quiet" lang="en">${detail}</p>`}
    ${fix.text && html`<p class="quiet" lang=${fix.lang}>→ ${fix.text}</p>`}`;
};

function Codes() {
  const [wanted, setWanted] = useState('');
  const help = useAsked('/help');
  const list = (help.data?.help ?? []).map((entry) => ({ code: entry.code, ...meaning(entry) }))
    .filter(({ code, text }) => `${code} ${text}`.toLowerCase().includes(wanted.toLowerCase()));
  return html`<${Card} title=${t('help.codes')} id="codes" wide="3"><${Missing} asked=${help} none=${t('missing.none')} />
    ${help.data && html`<label for="find-code">${t('help.find')}</label><input id="find-code" type="search" value=${wanted} onInput=${(event) => setWanted(event.target.value)} />
      <ul class="plain codes">${list.map(({ code, text, lang }) => html`<li><a href=${linkTo('help', code)}>${code}</a> <span lang=${lang}>${text}</span></li>`)}</ul>`}
  </${Card}>`;
}
