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

export function Uncertainty({ document }) {
  const { U_mm, point, limit_mm, warning_mm } = expanded(document);
  return html`<p class="figure">${U_mm === null ? '—' : `± ${mm(U_mm)}`}</p>
    <p class="quiet">${t('U.of')}${point ? ` · ${t('U.at')} ` : ''}${point && html`<span lang="en">${point}</span>`}</p>
    ${limit_mm && html`<${Scale} value=${U_mm} warning=${warning_mm} limit=${limit_mm} />`}`;
}
