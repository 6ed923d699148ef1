// The arm as built: whether its own errors were taken up, what each model explains, and the field of errors before and after.
import { html } from '../vendor/preact.js';
import { fixed, mm, significant, vector } from '../state/numbers.js';
import { t } from '../state/words.js';
import { Card, Facts } from './card.js';
import { ErrorField } from './error_field.js';
import { Missing, useAsked } from './loaded.js';

const CODES = new Set(['arm-errors', 'arm-as-drawn']);
const SHOWN = 6;

/** Nothing where the arm's errors were not asked for: the verdict's findings say whether they were. */
/** Whether errors of the arm were looked for. */
export const armIdentified = (document) => document.verdict.findings.some(({ code }) => CODES.has(code));

export function ArmErrors({ document, path }) {
  const identified = armIdentified(document);
  const arm = useAsked(identified ? `${path}/arm` : null);
  const field = useAsked(arm.data?.taken_up ? `${path}/arm/field` : null);
  if (!identified) return null;
  return html`<${Card} title=${t('arm.title')} id="arm-errors" wide="3"><${Missing} asked=${arm} />
    ${arm.data && html`<${Found} arm=${arm.data} />`}
    ${arm.data?.taken_up && html`<div class="halves"><div>${field.data ? html`<${ErrorField} field=${field.data} />` : html`<${Missing} asked=${field} none=${t('field.none')} />`}</div><${Largest} parameters=${arm.data.parameters} /></div>`}
  </${Card}>`;
}

function Found({ arm }) {
  const [drawn, ...models] = arm.ladder;
  const best = models.reduce((a, b) => (b.probability > a.probability ? b : a), models[0]);
  return html`<p class="sentence">${arm.taken_up ? `✓ ${t('arm.taken')}` : `○ ${t('arm.not-taken')}`}</p>
    <${Facts} rows=${[
      [t('arm.model'), arm.arm], [t('arm.from'), t('arm.views', { views: arm.views, places: arm.places })],
      drawn && best && [t('arm.hold-out'), `${mm(drawn.hold_out_mm)} → ${mm(best.hold_out_mm)}`],
      [t('arm.scatter'), `${mm(arm.scatter_mm)}, ${fixed(arm.scatter_deg, 3)}°`],
    ]} />
    ${arm.more_views && html`<${MoreViews} predicted=${arm.more_views} />`}
    <div class="table-frame" tabindex="0" role="group" aria-label=${t('arm.ladder')}><table><caption>${t('arm.ladder')}</caption>
      <thead><tr><th scope="col">${t('arm.up-to')}</th><th scope="col" class="num">${t('touch.probability')}</th><th scope="col" class="num">${t('arm.left-out')}</th></tr></thead>
      <tbody>${arm.ladder.map((row) => html`<tr><th scope="row">${t(`arm.group.${row.up_to ?? 'none'}`)}</th><td class="num">${row.up_to === null ? '—' : `${fixed(100 * row.probability, 0)} %`}</td><td class="num">${mm(row.hold_out_mm)}</td></tr>`)}</tbody></table></div>`;
}

/** What more views would leave of the error of a registered point. */
function MoreViews({ predicted: { now_mm, after, box_mm } }) {
  const last = after.at(-1);
  if (!last) return null;
  const [low, high] = box_mm.map((corner) => vector(corner, 0));
  return html`<p><b>${t('arm.more', { more: last.more, now: mm(now_mm), then: mm(last.point_mm) })}</b></p>
    <p class="small quiet">${after.slice(0, -1).map(({ more, point_mm }) => `${t('arm.more-after', { more, then: mm(point_mm) })} `)}${t('arm.more-box', { low, high })}</p>`;
}

/** The errors that stand out most from their uncertainty, with U (k = 2). */
function Largest({ parameters }) {
  const shown = parameters.filter(({ value }) => value !== 0).sort((a, b) => Math.abs(b.value) / b.sigma - Math.abs(a.value) / a.sigma).slice(0, SHOWN);
  return html`<div class="table-frame" tabindex="0" role="group" aria-label=${t('arm.largest')}><table><caption>${t('arm.largest')}</caption>
    <thead><tr><th scope="col">${t('arm.error')}</th><th scope="col" class="num">${t('arm.axis')}</th><th scope="col" class="num">${t('arm.value')}</th></tr></thead>
    <tbody>${shown.map((one) => html`<tr><th scope="row">${t(`arm.group.${one.group}`)} <span class="small quiet mono">${one.name}</span></th><td class="num">${one.axis}</td><td class="num nowrap">${significant(one.value, 2)} ± ${significant(2 * one.sigma, 2)} ${one.unit}</td></tr>`)}</tbody></table></div>`;
}
