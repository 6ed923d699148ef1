// An uncertainty as everybody reads it: U (k = 2) at the worst of the points that matter, on its scale.
import { html } from '../vendor/preact.js';
import { mm } from '../state/numbers.js';
import { t } from '../state/words.js';
import { Scale } from './scale.js';

/** { U_mm, point, limit_mm, warning_mm } of a calibration document; null for what it does not have. */
export function expanded(document) {
  const { uncertainty, verdict } = document;
  const worst = uncertainty?.points?.reduce((a, b) => (b.expanded_mm > a.expanded_mm ? b : a), uncertainty.points[0]);
  return {
    U_mm: worst?.expanded_mm ?? (uncertainty ? 2 * uncertainty.point_mm : null),
    point: worst?.name ?? null,
    limit_mm: verdict.limits?.tolerance_mm ?? null,
    warning_mm: verdict.limits ? Math.min(2 * verdict.limits.point_warning_mm, verdict.limits.tolerance_mm) : null,
  };
}

const VOLUME = ['near', 'middle', 'far', 'top', 'bottom', 'left', 'right'];

/** The name of a point in words: those of the working volume in this language, a user's own as it is. */
function PointName({ name }) {
  const parts = name.split(' ');
  if (parts.length !== 3 || !parts.every((part) => VOLUME.includes(part))) return html`<span lang="">${name}</span>`;
  return html`<span>${parts.map((part) => t(`volume.${part}`)).join(' ')}</span>`;
}

export function Uncertainty({ document }) {
  const { U_mm, point, limit_mm, warning_mm } = expanded(document);
  return html`<p class="figure">${U_mm === null ? '—' : `± ${mm(U_mm)}`}</p>
    <p class="quiet">${t('U.of')}${point ? ` · ${t('U.at')} ` : ''}${point && html`<${PointName} name=${point} />`}</p>
    ${limit_mm && html`<${Scale} value=${U_mm} warning=${warning_mm} limit=${limit_mm} />`}`;
}
