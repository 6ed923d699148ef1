// Devices: what the daemon is connected to, since when, the last error; a check in which nothing moves; the sensors of the rig.
import { html, useState } from '../vendor/preact.js';
import { Act } from '../parts/act.js';
import { Card, Facts } from '../parts/card.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { Cause } from '../parts/problem.js';
import { Rigs } from '../parts/rig.js';
import { ask } from '../state/ask.js';
import { moment } from '../state/numbers.js';
import { may, old } from '../state/now.js';
import { linkTo } from '../state/place.js';
import { deviceName, sentences, t } from '../state/words.js';

export function Devices() {
  const devices = useAsked('/devices', ['device']);
  const [checks, setChecks] = useState(null);
  const list = devices.data?.devices ?? (Array.isArray(devices.data) ? devices.data : []);
  const check = async () => {
    setChecks(null);
    const { data } = await ask('/check', { method: 'POST', limit_s: 60 });
    setChecks(data.results ?? data);
    devices.again();
  };
  return html`<div class="grid">
    <${Missing} asked=${devices} />
    ${list.map((device) => html`<${Device} device=${device} />`)}
    <${Card} title=${t('check.title')} id="check" wide="3"><p>${t('check.about')}</p>
      ${may('operator') ? html`<${Act} label=${t('check.start')} act=${check} />` : html`<p class="quiet">${t('missing.role')}</p>`}
      ${checks && html`<ul class="findings">${checks.map(({ name, ok, ...said }) => [name, ok, ...sentences([said.what, said.fix], [said.what_detail, said.fix_detail])]).map(([name, ok, what, fix]) => html`<li class=${ok ? 'info' : 'error'}>
        <span class="mark" role="img" aria-label=${t(ok ? 'check.good' : 'check.bad')}>${ok ? '✓' : '✕'}</span><div><p><b>${name}</b> <span lang=${what.lang}>${what.text}</span></p>${!ok && fix.text && html`<p class="quiet" lang=${fix.lang}>→ ${fix.text}</p>`}</div></li>`)}</ul>`}
    </${Card}>
    <${Rigs} />
  </div>`;
}

function Device({ device: { name, kind, address, connected, detail, since, last_error } }) {
  return html`<${Card} title=${deviceName(name ?? kind)} id=${`device-${name ?? kind}`}>
    <p class=${`sentence ${old.value ? 'dimmed' : ''}`}><span aria-hidden="true">${connected ? '●' : '✕'}</span> ${t(connected ? 'device.up' : 'device.down')}</p>
    <${Facts} rows=${[
      address && [t('device.address'), html`<span class="mono">${address}</span>`], since && [t('device.since'), moment(since)],
      detail && [t('device.detail'), html`<span lang="en">${detail}</span>`],
    ]} />
    ${last_error && html`<div class="note warn"><${Cause} cause=${last_error} />
      <p class="small quiet"><a href=${linkTo('help', last_error.code)}>${last_error.code}</a> · ${moment(last_error.at)}</p></div>`}
  </${Card}>`;
}
