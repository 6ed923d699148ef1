// What is wrong with all that is shown: no link, refused, nobody asked, drift, a newer daemon.
import { html, useEffect, useState } from '../vendor/preact.js';
import { fixed } from '../state/numbers.js';
import { age_s, changed, lost, ready, refused, running, session } from '../state/now.js';
import { ask } from '../state/ask.js';
import { Cause } from './problem.js';
import { sentences, t } from '../state/words.js';

const Banner = ({ kind = 'warn', role = 'alert', children }) =>
  html`<div class="banner ${kind}" role=${role}><span class="mark" aria-hidden="true">${kind === 'info' ? 'i' : '!'}</span><div>${children}</div></div>`;

export function Banners() {
  const signedIn = session.value && session.value.role !== 'nobody';
  const updated = useUpdated();
  return html`<div class="banners">
    ${signedIn && lost.value && html`<${Banner}><p><b>${age_s.value === null ? t('lost.never') : t('lost', { s: fixed(age_s.value, 0) })}</b></p><p>${t('lost.arm')}</p></${Banner}>`}
    ${signedIn && refused.value && html`<${Banner}><${Cause} cause=${{ ...refused.value, what: refused.value.detail }} /></${Banner}>`}
    ${changed.value['end-unconfirmed'] && html`<${Banner}><p><b>${t('end.unconfirmed')}</b></p></${Banner}>`}
    ${sentences(ready.value?.warnings ?? [], ready.value?.warning_details).map(({ text, lang }) => html`<${Banner}><p lang=${lang}>${text}</p></${Banner}>`)}
    ${updated && html`<${Banner} kind="info" role="status"><p>${t('updated')} <button type="button" onClick=${() => location.reload()}>${t('updated.load')}</button></p></${Banner}>`}
  </div>`;
}

/** True when the daemon became another one since the page was loaded; reloads by itself when nothing goes on. */
function useUpdated() {
  const [updated, setUpdated] = useState(false);
  const [first] = useState(() => ({ software: null }));
  const linked = !lost.value;
  useEffect(() => {
    if (!linked) return undefined;
    ask('/session').then(({ data }) => {
      first.software ??= data.software;
      setUpdated(data.software !== first.software);
    }, () => {});
    return undefined;
  }, [linked]);
  useEffect(() => {
    if (!updated || running.value) return undefined;
    let waiting;
    const again = () => {
      clearTimeout(waiting);
      waiting = setTimeout(() => location.reload(), 60_000);
    };
    again();
    const acts = ['pointerdown', 'keydown'];
    for (const act of acts) addEventListener(act, again);
    return () => {
      clearTimeout(waiting);
      for (const act of acts) removeEventListener(act, again);
    };
  }, [updated, running.value]);
  return updated;
}
