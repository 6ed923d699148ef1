// Settings as loaded (to read), keys (to make, rotate, revoke), versions, and this device's choices.
import { html, useState } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Card, Facts } from '../parts/card.js';
import { Choices } from '../parts/choices.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { ask } from '../state/ask.js';
import { moment } from '../state/numbers.js';
import { may } from '../state/now.js';
import { t } from '../state/words.js';

export function Settings() {
  const about = useAsked('/about');
  return html`<div class="grid">
    <${Choices} />
    <${Card} title=${t('about.title')} id="about" wide="half"><${Missing} asked=${about} none=${t('missing.none')} />${about.data && html`<${About} about=${about.data} />`}</${Card}>
    ${may('admin') ? html`<${Keys} /><${Loaded} />` : html`<${Card} title=${t('settings.title')} id="role"><p class="quiet">${t('missing.role')}</p></${Card}>`}
  </div>`;
}

function About({ about: { software, licence, python, packages = [] } }) {
  return html`<${Facts} rows=${[[t('about.software'), software], [t('about.licence'), licence], ['Python', python]]} />
    <details><summary>${t('about.packages', { count: packages.length })}</summary>
      <ul class="plain codes">${packages.map((one) => html`<li><span class="mono">${one.name} ${one.version}</span> <span class="small quiet" lang="en">${one.licence}</span></li>`)}</ul></details>`;
}

function Loaded() {
  const settings = useAsked('/settings');
  return html`<${Card} title=${t('settings.title')} id="settings" wide="3"><p class="quiet">${t('settings.about')}</p><${Missing} asked=${settings} none=${t('missing.none')} />
    ${settings.data && html`<${Tree} value=${settings.data.settings} given=${settings.data.given} />`}</${Card}>`;
}

/** Any JSON as nested lists of terms; text stays text. What is not in `given` is a default, and greyed. */
function Tree({ value, given = value }) {
  if (value === null || typeof value !== 'object') return html`<span class="mono">${value === null ? '—' : String(value)}</span>`;
  if (Array.isArray(value) && value.every((one) => one === null || typeof one !== 'object')) return html`<span class="mono">${value.join(', ')}</span>`;
  return html`<dl class="tree">${Object.entries(value).map(([name, part]) => {
    const set = isGiven(given, name);
    return html`<div class=${set ? '' : 'default'}><dt lang="en">${name}</dt><dd><${Tree} value=${part} given=${set && typeof given === 'object' && !Array.isArray(given) ? given[name] : part} />${!set && html` <span class="small">${t('settings.default')}</span>`}</dd></div>`;
  })}</dl>`;
}

function isGiven(given, name) {
  if (Array.isArray(given) && given.every((one) => typeof one === 'string')) return given.includes(name) || given.some((one) => one.startsWith(`${name}.`));
  return given !== null && typeof given === 'object' ? name in given : true;
}

function Keys() {
  const keys = useAsked('/keys', ['key']);
  const [made, setMade] = useState(null);
  const list = keys.data?.keys ?? [];
  const add = async (event) => {
    event.preventDefault();
    const form = new FormData(event.target);
    const { data } = await ask('/keys', { method: 'POST', body: { name: form.get('name').trim(), role: form.get('role') } });
    setMade(data);
    keys.again();
  };
  return html`<${Card} title=${t('keys.title')} id="keys" wide="3"><${Missing} asked=${keys} none=${t('missing.none')} />
    ${made && html`<div class="note info"><p>${t('first-key.once')} <b>${made.name}</b></p><output class="key">${made.key}</output></div>`}
    ${list.length > 0 && html`<ul class="plain keys">${list.map((key) => html`<${Key} key=${key.id} record=${key} changed=${(data) => { if (data?.key) setMade(data); keys.again(); }} />`)}</ul>`}
    ${keys.data && html`<${KeyForm} add=${add} />`}
  </${Card}>`;
}

function KeyForm({ add }) {
  return html`<form onSubmit=${add} class="inline">
    <div><label for="key-name">${t('setup.name')}</label><input id="key-name" name="name" required maxlength="60" autocomplete="off" /></div>
    <div><label for="key-role">${t('person.role')}</label><select id="key-role" name="role">${['viewer', 'operator', 'admin'].map((role) => html`<option value=${role}>${t(`role.${role}`)}</option>`)}</select></div>
    <button type="submit">${t('keys.make')}</button></form>`;
}

function Key({ record: { name, role, created_at, expires_at, state }, changed }) {
  const [sure, setSure] = useState('');
  const post = (what, body) => async () => changed((await ask(`/keys/${encodeURIComponent(name)}/${what}`, { method: 'POST', body })).data);
  return html`<li><details><summary><b>${name}</b> ${t(`role.${role}`)} ${state && state !== 'valid' && html`<span class="quiet">${t(`keys.state.${state}`)}</span>`}</summary>
    <${Facts} rows=${[created_at && [t('pose.made'), moment(created_at)], expires_at && [t('person.until'), moment(expires_at)]]} />
    <label for=${`sure-${name}`}>${t('keys.sure', { name })}</label><input id=${`sure-${name}`} value=${sure} autocomplete="off" onInput=${(event) => setSure(event.target.value)} />
    <div class="row"><${Act} label=${t('keys.rotate')} disabled=${sure !== name} act=${post('rotate', {})} /><${Act} label=${t('keys.revoke')} disabled=${sure !== name} act=${post('revoke')} /></div>
  </details></li>`;
}
