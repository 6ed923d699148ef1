// A refusal in words: what, what to do, code and the request's id; 409 is information, not an error.
import { html } from '../vendor/preact.js';
import { LINK_LOST } from '../state/ask.js';
import { linkTo } from '../state/place.js';
import { sentence, t } from '../state/words.js';

export function ProblemNote({ problem, again }) {
  const { status, code, requestId, problem: told = {} } = problem;
  const link = code === LINK_LOST;
  const said = sentence({ id: told.id ?? code, params: told.params, message: link ? t('problem.link') : (told.detail ?? '') });
  const fix = link ? t('problem.link-fix') : told.fix;
  return html`<div class="note ${status === 409 ? 'info' : 'warn'}" role="alert">
    <p><span class="mark" aria-hidden="true">${status === 409 ? 'i' : '!'}</span> <span lang=${said.lang}>${said.text}</span></p>
    ${told.reasons?.map((reason) => html`<p lang="en">· ${reason}</p>`)}
    ${told.problems?.map(({ place, what, fix: how }) => html`<p lang="en">· ${place}: ${what}. → ${how}</p>`)}
    ${fix && html`<p class="quiet" lang=${link ? undefined : 'en'}>→ ${fix}</p>`}
    ${code && !link && html`<p class="small quiet"><a href=${linkTo('help', code)}>${code}</a>${requestId && ` · ${t('problem.request')} ${requestId}`}</p>`}
    ${again && html`<button type="button" onClick=${again}>${t('problem.again')}</button>`}
  </div>`;
}
