// A calibration as files of other systems.
import { html } from '../vendor/preact.js';
import { t } from '../state/words.js';
import { Missing, useAsked } from './loaded.js';

/** Each format as a link that saves its file. */
export function Exports({ path }) {
  const list = useAsked(`${path}/exports`);
  return html`<${Missing} asked=${list} none=${t('exports.none')} />
    <ul class="plain exports">${list.data?.exports.map(({ format, file, about, href }) =>
      html`<li key=${format}><a href=${href} download=${file} class="mono">${file}</a> <span class="small quiet" lang="en">${about}</span></li>`)}</ul>`;
}
