// Always there, in one row: cell, places, robot, the age of what is shown, help, who is signed in, "End run".
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { fixed } from '../state/numbers.js';
import { age_s, holder, lost, may, note, old, robot, run, running, session } from '../state/now.js';
import { linkTo, place } from '../state/place.js';
import { t } from '../state/words.js';

/** The places, and the screens that each of them holds; the first one is what the place opens with. */
export const PLACES = {
  cell: ['cell', 'jog'], calibrate: ['calibrate', 'run', 'result'], check: ['verify'], scans: ['scans'], history: ['history', 'audit'], 'set-up': ['devices', 'settings', 'setup'],
};
const TABS = { history: PLACES.history, 'set-up': PLACES['set-up'] };
const ADMIN = new Set(['audit', 'setup']);
const ON_A_PHONE = 4; // the rest is below "More"

const placeOf = (screen) => Object.keys(PLACES).find((name) => PLACES[name].includes(screen));

export function Header({ screen }) {
  return html`<header class="top">
    <a class="cell-name" href=${linkTo('cell')}>${session.value?.cell || 'handeyed'}</a>
    <${Places} here=${placeOf(screen)} />
    <${StateLine} />
    <a class="round" href=${linkTo('help')} aria-current=${screen === 'help' ? 'page' : undefined}><span aria-hidden="true">?</span><span class="sr-only">${t('place.help')}</span></a>
    <${Who} />
    <${EndRun} />
  </header>`;
}

function Places({ here }) {
  const [open, setOpen] = useState(false);
  useEffect(() => setOpen(false), [place.value]);
  const link = (name) => html`<li class=${Object.keys(PLACES).indexOf(name) < ON_A_PHONE ? '' : 'further'}><a href=${linkTo(PLACES[name][0])} aria-current=${name === here ? 'page' : undefined}>${t(`place.${name}`)}</a></li>`;
  return html`<nav aria-label=${t('places')} class=${open ? 'open' : ''}>
    <ul id="places">${Object.keys(PLACES).map(link)}<li class="phone"><a href=${linkTo('jog')}>${t('place.jog')}</a></li></ul>
    <button type="button" class="menu" aria-expanded=${open} aria-controls="places" onClick=${() => setOpen(!open)}>${t('places.more')}</button>
  </nav>`;
}

/** The screens of one place beside each other, where it has more than one and they are no steps of a flow. */
export function Tabs({ screen }) {
  const names = (TABS[placeOf(screen)] ?? []).filter((name) => !ADMIN.has(name) || may('admin'));
  if (names.length < 2) return null;
  return html`<nav class="tabs" aria-label=${t(`place.${placeOf(screen)}`)}>${names.map((name) => html`<a class="chip button" href=${linkTo(name)} aria-current=${name === screen ? 'page' : undefined}>${t(`place.${name}`)}</a>`)}</nav>`;
}

function StateLine() {
  return html`<dl class="line">
    <div class=${old.value ? 'dimmed' : ''}><dt class="sr-only">${t('head.robot')}</dt><dd>${robotWords()}</dd></div>
    <div><dt class="sr-only">${t('head.age')}</dt><dd>${ageWords()}</dd></div>
  </dl>`;
}

function ageWords() {
  if (age_s.value === null) return html`<span>○ ${t('age.none')}</span>`;
  if (!old.value) return html`<span><span aria-hidden="true">●</span> ${t('age.now')}</span>`;
  return html`<b><span aria-hidden="true">${lost.value ? '✕' : '○'}</span> ${t('age.old', { s: fixed(age_s.value, 0) })}</b>`;
}

function robotWords() {
  const now = robot.value;
  if (!now) return `○ ${t('robot.unknown')}`;
  if (!now.connected) return html`<b>✕ ${t('robot.lost')}</b>`;
  if (now.emergency_stop) return html`<b>! ${t('robot.emergency')}</b>`;
  if (!now.motors_on) return `○ ${t('robot.off')}`;
  if (!now.automatic) return `○ ${t('robot.manual')}`;
  return `● ${t(now.moving ? 'robot.moving' : 'robot.on')}`;
}

function Who() {
  const { name, role } = session.value ?? {};
  const nobody = !role || role === 'nobody';
  const said = nobody ? t('who.nobody') : `${name}, ${t(`role.${role}`)}`;
  return html`<a class="round who" href=${linkTo('sign-in')} title=${said}><span aria-hidden="true">${nobody ? '–' : [...name].slice(0, 2).join('')}</span><span class="sr-only">${said}</span></a>`;
}

/** Ends the run in progress at once. Pressed without a link, it is sent as soon as there is one again. */
function EndRun() {
  const [state, setState] = useState('idle'); // idle, waiting, sent
  const wanted = useRef(null);
  const send = async () => {
    setState('sent');
    try {
      await ask(`/runs/${encodeURIComponent(wanted.current)}/abort`, { method: 'POST' });
      note('run');
    } catch (error) {
      if (error.status === 0) return setState('waiting');
      if (error.status !== 409) note('end-unconfirmed');
    }
    wanted.current = null;
    setState('idle');
    return undefined;
  };
  useEffect(() => {
    if (state === 'waiting' && !old.value) send();
  }, [state, old.value]);
  const off = !running.value || !may('operator');
  const press = () => {
    if (off) return;
    wanted.current = run.value.id;
    send();
  };
  const waits = state === 'waiting' ? 'end.waiting' : state === 'sent' ? 'end.sent' : 'end';
  return html`<button type="button" class="end-run" aria-disabled=${off ? 'true' : undefined} onClick=${press}>
    <span><span aria-hidden="true">■</span> ${t(waits)}</span><small>${running.value ? t('end.note') : holder.value ? t('run.held', { by: holder.value }) : t('run.none')}</small>
  </button>`;
}
