// A refusal in words: what, what to do, code and the request's id; 409 is information, not an error.
import { html } from '../vendor/preact.js';
import { LINK_LOST } from '../state/ask.js';
import { linkTo } from '../state/place.js';
import { causeWords, t } from '../state/words.js';

export function ProblemNote({ problem, again }) {
  const { status, code, requestId, problem: told = {} } = problem;
  const link = code === LINK_LOST;
  const words = link
    ? { what: { text: t('problem.link') }, fix: { text: t('problem.link-fix') } }
    : causeWords({ ...told, code, what: told.detail ?? '', fix: told.fix });
  return html`<div class="note ${status === 409 ? 'info' : 'warn'}" role="alert">
    <p><span class="mark" aria-hidden="true">${status === 409 ? 'i' : '!'}</span> <span lang=${words.what.lang}>${words.what.text}</span></p>
    ${words.detail && html`<p class="small" lang="en">${words.detail}</p>`}
    ${told.problems?.map(({ place, what, fix: how }) => html`<p lang="en">· ${place}: ${what}. → ${how}</p>`)}
    ${words.fix.text && html`<p class="quiet" lang=${words.fix.lang}>→ ${words.fix.text}</p>`}
    ${code && !link && html`<p class="small quiet"><a href=${linkTo('help', code)}>${code}</a>${requestId && ` · ${t('problem.request')} ${requestId}`}</p>`}
    ${again && html`<button type="button" onClick=${again}>${t('problem.again')}</button>`}
  </div>`;
}

/** Why something failed, { code, what, fix }, with what to do. */
export function Cause({ cause }) {
  const { what, fix, detail } = causeWords(cause);
  return html`<p><span class="mark" aria-hidden="true">!</span> <span lang=${what.lang}>${what.text}</span></p>
    ${detail && html`<p class="small" lang="en">${detail}</p>`}
    ${fix.text && html`<p class="quiet" lang=${fix.lang}>→ ${fix.text}</p>`}`;
}
