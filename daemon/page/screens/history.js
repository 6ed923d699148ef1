// History: runs, calibrations, what was activated, and scans in one line of time; by kind and state.
import { html, useState } from '../vendor/preact.js';
import { Card } from '../parts/card.js';
import { activator } from '../parts/in_force.js';
import { Missing, useAsked } from '../parts/loaded.js';
import { mm, moment } from '../state/numbers.js';
import { linkTo } from '../state/place.js';
import { causeWords, t } from '../state/words.js';

const KINDS = ['all', 'run', 'calibration', 'applied', 'scan'];

export function History() {
  const [kind, setKind] = useState('all');
  const [most, setMost] = useState(30);
  const runs = useAsked(`/runs?limit=${most}`, ['run']);
  const calibrations = useAsked(`/calibrations?limit=${most}`, ['calibration', 'applied', 'run']);
  const scans = useAsked(`/scans?limit=${most}`, ['scan', 'run']);
  const rows = rowsOf(runs.data?.runs, calibrations.data, scans.data?.scans).filter((row) => kind === 'all' || row.kind === kind).slice(0, most);
  const more = [runs, calibrations, scans].some(({ data }) => data?.next);
  return html`<${Card} title=${t('place.history')} id="history">
    <div class="row" role="group" aria-label=${t('history.kind')}>${KINDS.map((name) => html`<button type="button" class="chip" aria-pressed=${kind === name} onClick=${() => setKind(name)}>${t(`history.${name}`)}</button>`)}</div>
    <${Missing} asked=${runs} />
    ${runs.data && !rows.length && html`<p class="quiet">${t('history.none')}</p>`}
    <ul class="timeline">${rows.map((row) => html`<li key=${row.key}><a href=${row.link}>
      <span class="sign" aria-hidden="true">${row.sign}</span><span class="when">${moment(row.at)}</span><span class="what"><b>${row.title}</b> ${row.words}</span></a></li>`)}</ul>
    ${more && most < 100 && html`<button type="button" onClick=${() => setMost(100)}>${t('history.more')}</button>`}
  </${Card}>`;
}

export function rowsOf(runs = [], lists, scans = []) {
  const { calibrations = [], applied = [] } = lists ?? {};
  const sign = (state) => ({ finished: '✓', failed: '✕', aborted: '■' })[state] ?? '…';
  return [
    ...runs.map((run) => ({
      kind: 'run', key: `r${run.id}`, at: run.created_at, link: linkTo('run', run.id), sign: sign(run.state), title: t(`kind.${run.kind}`),
      words: html`${t(`state.${run.state}`)}${run.started_by && ` · ${run.started_by}`}${run.cause && html` · <span lang=${causeWords(run.cause).what.lang}>${causeWords(run.cause).what.text}</span>`}`,
    })),
    ...calibrations.map(({ id, created_at, accepted, expanded_mm, current }) => ({
      kind: 'calibration', key: `c${id}`, at: created_at, link: linkTo('result', id), sign: accepted ? '✓' : '✕', title: t('place.result'),
      words: `${t(accepted ? 'verdict.accepted' : 'verdict.refused')}${expanded_mm ? `, ± ${mm(expanded_mm)}` : ''}${current ? ` · ${t('result.in-force')}` : ''}`,
    })),
    ...applied.map(({ calibration_id, applied_at, applied_by, sequence }) => ({
      kind: 'applied', key: `a${sequence}`, at: applied_at, link: linkTo('result', calibration_id), sign: '●', title: t('history.put'), words: activator(applied_by),
    })),
    ...scans.map(({ id, name, created_at, views }) => ({
      kind: 'scan', key: `s${id}`, at: created_at, link: linkTo('scans', id), sign: '◇', title: t('kind.scan'), words: `${name} · ${t('scan.views', { count: views.length })}`,
    })),
  ].sort((a, b) => (a.at < b.at ? 1 : -1));
}
