// The audit log: who did what; whether its chain of hashes is whole.
import { html, useState } from '../vendor/preact.js';
import { Card } from '../parts/card.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { moment } from '../state/numbers.js';
import { t } from '../state/words.js';

export function Audit() {
  const [link, setLink] = useState('/audit?limit=50');
  const rows = useAsked(link);
  const verified = useAsked('/audit/verified', [], { late: true });
  return html`<div class="grid">
    <${Card} title=${t('audit.chain')} id="chain" brief wide="3"><${Missing} asked=${verified} none=${t('missing.wait')} />
      ${verified.data && html`<p class="sentence">${verified.data.whole ? `✓ ${t('audit.whole')}` : `✕ ${t('audit.broken')}`}</p>
        <p class="quiet">${t('audit.rows', { count: verified.data.rows, at: moment(verified.data.checked_at) })}</p>`}
    </${Card}>
    <${Card} title=${t('place.audit')} id="audit" wide="3"><${Missing} asked=${rows} />
      ${rows.data && html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('place.audit')}><table><thead><tr><th scope="col" class="num">${t('audit.number')}</th><th scope="col">${t('drift.at')}</th><th scope="col">${t('audit.who')}</th><th scope="col">${t('audit.what')}</th><th scope="col">${t('audit.subject')}</th></tr></thead>
        <tbody>${rows.data.rows.map((row) => html`<tr><th scope="row" class="num">${row.sequence}</th><td class="moment">${moment(row.at)}</td><td>${row.actor} <span class="quiet">${row.role}</span></td><td>${row.action}</td><td class="mono nowrap">${row.subject}</td></tr>`)}</tbody></table></div>
        <div class="row">${rows.data.next && html`<button type="button" onClick=${() => setLink(rows.data.next)}>${t('audit.older')}</button>`}
        ${link !== '/audit?limit=50' && html`<button type="button" onClick=${() => setLink('/audit?limit=50')}>${t('audit.newest')}</button>`}
        <a class="button" href=${link} download="audit.json">${t('download')}</a></div>`}
    </${Card}>
  </div>`;
}
