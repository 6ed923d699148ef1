// Always there: cell, places, robot, run and who started it, the age of what is shown, who is signed in, "End run".
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { fixed, timeOfDay } from '../state/numbers.js';
import { age_s, holder, lost, may, note, old, robot, run, running, session } from '../state/now.js';
import { linkTo, place } from '../state/place.js';
import { t } from '../state/words.js';

const PLACES = ['cell', 'calibrate', 'run', 'result', 'verify', 'scans', 'jog', 'devices', 'history', 'audit', 'settings', 'help'];
const ADMIN = new Set(['audit']);

export function Header({ screen }) {
  return html`<header class="top">
    <div class="state">
      <a class="cell-name" href=${linkTo('cell')}>${session.value?.cell || 'handeyed'}</a>
      <${StateLine} />
      <${Who} />
      <${EndRun} />
    </div>
    <${Places} screen=${screen} />
  </header>`;
}

function Places({ screen }) {
  const [open, setOpen] = useState(false);
  useEffect(() => setOpen(false), [place.value]);
  const places = PLACES.filter((name) => !ADMIN.has(name) || may('admin'));
  return html`<nav aria-label=${t('places')} class=${open ? 'open' : ''}>
    <button type="button" class="menu" aria-expanded=${open} aria-controls="places" onClick=${() => setOpen(!open)}>
      <span aria-hidden="true">☰</span> ${t(`place.${screen}`)}
    </button>
    <ul id="places">${places.map((name) => html`<li><a href=${linkTo(name)} aria-current=${name === screen ? 'page' : undefined}>${t(`place.${name}`)}</a></li>`)}</ul>
  </nav>`;
}

function StateLine() {
  const dim = old.value ? 'dimmed' : '';
  return html`<dl class="line">
    <div class=${dim}><dt>${t('head.robot')}</dt><dd>${robotWords()}</dd></div>
    <div class=${dim}><dt>${t('head.run')}</dt><dd>${runWords()}</dd></div>
    <div><dt>${t('head.age')}</dt><dd>${ageWords()}</dd></div>
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

function runWords() {
  if (!running.value) return t(holder.value ? 'run.held' : 'run.none', { by: holder.value });
  const { kind, state, station, stations, started_by, created_at } = run.value;
  const step = ['moving', 'settling', 'capturing'].includes(state) && stations ? ` ${Math.min(station + 1, stations)}/${stations}` : '';
  return html`<a href=${linkTo('run')}>${t(`kind.${kind}`)}: ${t(`state.${state}`)}${step}</a>
    ${started_by && html` <span class="by">${t('run.by', { name: started_by, at: timeOfDay(created_at) })}</span>`}`;
}

function Who() {
  const { name, role } = session.value ?? {};
  return html`<div class="who"><a href=${linkTo('sign-in')}>${!role || role === 'nobody' ? t('who.nobody') : html`${name}<span class="quiet"> ${t(`role.${role}`)}</span>`}</a></div>`;
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
  return html`<div class="end"><button type="button" class="end-run" aria-disabled=${off ? 'true' : undefined} onClick=${press} aria-describedby="end-note">
    <span aria-hidden="true">■</span> ${t(state === 'waiting' ? 'end.waiting' : state === 'sent' ? 'end.sent' : 'end')}
  </button><span id="end-note" class="small quiet">${t('end.note')}</span></div>`;
}
