// Findings of the verdict: what, then what to do; a sign and a word each, never a colour alone.
import { html } from '../vendor/preact.js';
import { mm } from '../state/numbers.js';
import { sentence, t } from '../state/words.js';

const SIGN = { error: '✕', warning: '!', info: 'i' };

export function Findings({ findings }) {
  if (!findings.length) return html`<p class="quiet">${t('findings.none')}</p>`;
  return html`<ul class="findings">${findings.map((finding) => html`<${Finding} finding=${finding} />`)}</ul>`;
}

function Finding({ finding }) {
  const what = sentence({ id: finding.id, params: finding.params, message: finding.message });
  const fix = sentence({ ...finding.advice, message: finding.fix });
  return html`<li class=${finding.severity}>
    <span class="mark" role="img" aria-label=${t(`severity.${finding.severity}`)}>${SIGN[finding.severity]}</span>
    <div>
      <p lang=${what.lang}>${what.text}</p>
      <p class="quiet" lang=${fix.lang}>→ ${fix.text}</p>
      ${finding.effect_mm !== null && finding.effect_mm !== undefined && html`<p class="small quiet">${t('findings.effect', { mm: mm(finding.effect_mm) })}</p>`}
    </div>
  </li>`;
}
