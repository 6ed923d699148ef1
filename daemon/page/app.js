// The page: header, banners, and the screen of the place in the address.
import { Component, html, render, useEffect } from './vendor/preact.js';
import { Banners } from './parts/banners.js';
import { Header, Tabs } from './parts/header.js';
import { SensorChoice } from './parts/sensor_choice.js';
import { Whole } from './parts/whole.js';
import { ask } from './state/ask.js';
import { start } from './state/live.js';
import { refused, session } from './state/now.js';
import { place } from './state/place.js';
import { createScreens } from './state/screens.js';
import { loadSession } from './state/session.js';
import { useTouch } from './state/touch.js';
import { spoken, t } from './state/words.js';

const SCREENS = {
  cell: () => import('./screens/cell.js').then(({ Cell }) => Cell),
  calibrate: () => import('./screens/calibrate.js').then(({ Calibrate }) => Calibrate),
  run: () => import('./screens/run.js').then(({ Run }) => Run),
  jog: () => import('./screens/jog.js').then(({ Jog }) => Jog),
  result: () => import('./screens/result.js').then(({ Result }) => Result),
  verify: () => import('./screens/verify.js').then(({ Verify }) => Verify),
  scans: () => import('./screens/scans.js').then(({ Scans }) => Scans),
  devices: () => import('./screens/devices.js').then(({ Devices }) => Devices),
  history: () => import('./screens/history.js').then(({ History }) => History),
  audit: () => import('./screens/audit.js').then(({ Audit }) => Audit),
  settings: () => import('./screens/settings.js').then(({ Settings }) => Settings),
  setup: () => import('./screens/setup.js').then(({ Setup }) => Setup),
  help: () => import('./screens/help.js').then(({ Help }) => Help),
  'sign-in': () => import('./screens/sign_in.js').then(({ SignIn }) => SignIn),
};
const screens = createScreens(SCREENS);
const LONG_MS = 15_000;

/** All other screens, once the first is shown: a daemon that is replaced serves those of its own version only. */
async function fetchRest() {
  for (const name of Object.keys(SCREENS)) await screens.fetch(name);
}

/** Loads the whole page when a screen does not come though the daemon answers: some browsers keep a failed import. */
function loadAnewLater() {
  const timer = setInterval(() => void ask('/session').then(() => location.reload(), () => {}), LONG_MS);
  return () => clearInterval(timer);
}

/** A fault of one screen leaves header and "End run" as they are. */
class Guard extends Component {
  state = { error: null };

  componentDidCatch(error) {
    console.error(error);
    this.setState({ error });
  }

  render({ children }, { error }) {
    return error ? html`<p class="note warn" role="alert">${t('problem.page')} <span class="mono">${String(error.message)}</span></p>` : children;
  }
}

function Page() {
  const { screen, argument } = place.value;
  const known = screenOf(screen);
  const outside = session.value && session.value.role === 'nobody' && known !== 'help';
  const wanted = outside ? 'sign-in' : known;
  const Screen = screens.get(wanted);
  useTouch();
  useEffect(() => {
    screens.fetch(wanted);
  }, [wanted]);
  useEffect(() => (Screen ? undefined : loadAnewLater()), [wanted, !Screen]);
  useEffect(() => {
    document.title = `${t(`place.${wanted}`)} · ${session.value?.cell || 'handeyed'}`;
    document.querySelector('h1')?.focus({ preventScroll: true });
    scrollTo(0, 0);
  }, [wanted, argument]);
  return html`
    <a class="skip" href="#content" onClick=${toContent}>${t('skip')}</a>
    <${Header} screen=${known} />
    <main id="content" tabindex="-1">
      <h1 class="sr-only" tabindex="-1">${t(`place.${wanted}`)}</h1>
      ${session.value === null || !Screen ? html`<p class="quiet">${t('missing.wait')}</p>` : html`<${Guard} key=${`${wanted}/${argument}`}><${Whole}><${Tabs} screen=${wanted} /><${SensorChoice} screen=${wanted} named=${wanted !== 'verify' && argument} /><${Screen} argument=${argument} /></${Whole}></${Guard}>`}
      <${Banners} />
    </main>`;
}

function screenOf(name) {
  return name in SCREENS ? name : 'cell';
}

function toContent(event) {
  event.preventDefault();
  document.querySelector('#content').focus();
}

async function begin() {
  for (;;) {
    try {
      await loadSession();
      return;
    } catch (problem) {
      refused.value = { code: problem.code, detail: problem.message, ...problem.problem };
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }
}

screens.fetch(screenOf(place.peek().screen));
const begun = begin();
await spoken; // else all texts would change, and with them the places of all
render(html`<${Page} />`, document.body);
start();
begun.then(() => setTimeout(fetchRest, 2000));
