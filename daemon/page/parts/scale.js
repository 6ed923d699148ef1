// An uncertainty on its scale, with warning and limit: hatched where it warns, crossed where it is refused.
import { html } from '../vendor/preact.js';
import { mm } from '../state/numbers.js';
import { t } from '../state/words.js';

const WIDTH = 400;

export function Scale({ value, warning, limit }) {
  const end = Math.max(limit * 1.25, Math.min((value ?? 0) * 1.1, limit * 2.5));
  const x = (length) => Math.min(1, length / end) * WIDTH;
  const at = value === null || value === undefined ? null : Math.max(2, Math.min(WIDTH - 2, x(value)));
  return html`<figure class="scale">
    <svg viewBox="0 0 ${WIDTH} 34" role="img" aria-label=${t('scale.alt', { value: mm(value), warning: mm(warning), limit: mm(limit) })}>
      <defs>
        <pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><path class="hatch" d="M0 0V6" /></pattern>
        <pattern id="cross" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><path class="cross" d="M0 0V6M0 3H6" /></pattern>
      </defs>
      <rect class="fine" y="12" height="12" width=${x(warning)} />
      <rect class="warning" y="12" height="12" x=${x(warning)} width=${x(limit) - x(warning)} />
      <rect fill="url(#hatch)" y="12" height="12" x=${x(warning)} width=${x(limit) - x(warning)} />
      <rect class="refused" y="12" height="12" x=${x(limit)} width=${WIDTH - x(limit)} />
      <rect fill="url(#cross)" y="12" height="12" x=${x(limit)} width=${WIDTH - x(limit)} />
      ${at !== null && html`<path class="pointer" d="M${at} 30V8M${at - 6} 0H${at + 6}L${at} 9Z" />`}
    </svg>
    ${warning < limit && html`<figcaption class="small quiet"><span>${t('scale.warning')} ${mm(warning)}</span><span>${t('scale.limit')} ${mm(limit)}</span></figcaption>`}
  </figure>`;
}
