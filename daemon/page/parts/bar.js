// The bar on top of a screen: where it stands in the flow of a calibration, one sentence, and what to do now.
import { html } from '../vendor/preact.js';
import { linkTo } from '../state/place.js';
import { t } from '../state/words.js';

/** `mark`: a sign; `sentence` and `about` of it; the children are what can be done, the main one last. */
export function Bar({ steps, mark, sentence, about, children }) {
  return html`<section class="bar-top card" aria-label=${t('bar')}>
    ${steps}
    ${mark && html`<span class="mark" aria-hidden="true">${mark}</span>`}
    <div class="said">${sentence && html`<p class="sentence" role="status">${sentence}</p>`}${about && html`<div class="quiet">${about}</div>`}</div>
    <div class="acts">${children}</div>
  </section>`;
}

/** Prepare, pictures, result: `at` is the step shown; a step with an address can be gone to. */
export function Steps({ at, run, result }) {
  const links = { prepare: linkTo('calibrate'), pictures: run && linkTo('run', run), result: result && linkTo('result', result) };
  const names = Object.keys(links);
  return html`<ol class="flow" aria-label=${t('place.calibrate')}>${names.map((name, index) => {
    const words = html`<b aria-hidden="true">${index < names.indexOf(at) ? '✓' : index + 1}</b> ${t(`flow.${name}`)}`;
    return html`<li class=${name === at ? 'now' : ''}>${links[name] && name !== at ? html`<a href=${links[name]}>${words}</a>` : html`<span aria-current=${name === at ? 'step' : undefined}>${words}</span>`}</li>`;
  })}</ol>`;
}
