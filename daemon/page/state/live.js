// One stream for all tabs of this browser: the tab that holds the lock streams and passes on what it hears.
// When it closes, or is silent for longer than the link may be, another tab takes over.
import { batch } from '../vendor/preact.js';
import { refusal } from './ask.js';
import * as now from './now.js';
import { followStream } from './sse.js';

const LOCK = 'handeyed-live';
const TICK_MS = 500;
const AGAIN_MS = 1000;
const UNKNOWN_AGAIN_MS = 60_000; // nobody is signed in: whoever signs in wakes the stream
const SILENT_MS = 4000; // a stream without a beat for this long is given up; beats come every second

const channel = new BroadcastChannel(LOCK);
let leading = false;
let control = null; // of the streams, while this tab leads
let last = null; // the newest message of each kind, for tabs that open later
let lastEvent = '';
let wake = () => {};
let leaderHeard = performance.now();

export function start() {
  channel.onmessage = ({ data }) => onMessage(data);
  channel.postMessage({ kind: 'hello' });
  lead();
  let ticked = Date.now();
  setInterval(() => {
    const slept = Math.abs(Date.now() - ticked - TICK_MS) > 4000; // the machine slept, or its clock was set
    ticked = Date.now();
    now.clock.value = performance.now();
    if (slept) askAnew();
    else if (!leading && !document.hidden && performance.now() - leaderHeard > SILENT_MS) lead(true);
  }, TICK_MS);
  document.addEventListener('visibilitychange', () => {
    if (!document.hidden) now.clock.value = performance.now();
  });
}

/** Begin anew after signing in or out, and after sleep: what is shown counts as old until the daemon is heard. */
export function askAnew() {
  now.heardAt.value = null;
  leaderHeard = performance.now();
  if (leading) beginAgain();
  else channel.postMessage({ kind: 'anew' });
}

function onMessage(message) {
  if (message.kind === 'hello') {
    if (leading && last) channel.postMessage(last);
  } else if (message.kind === 'anew') {
    if (leading) beginAgain();
  } else {
    leaderHeard = performance.now();
    take(message);
  }
}

function beginAgain() {
  control?.abort();
  wake();
}

function pass(message) {
  channel.postMessage(message);
  take(message);
}

function take(message) {
  batch(() => {
    if (message.kind === 'live') takeLive(message.data);
    else if (message.kind === 'event') now.note(message.event, message.data);
    else if (message.kind === 'refused') now.refused.value = message.problem;
  });
}

function takeLive(data) {
  now.refused.value = null;
  if (now.heardAt.value === null) now.linked.value += 1;
  now.heardAt.value = performance.now();
  for (const name of ['robot', 'run', 'ready', 'devices', 'holder', 'look']) {
    if (name in data) now[name].value = data[name];
  }
  if ('ready_of' in data) now.readyOf.value = data.ready_of;
}

async function lead(steal = false) {
  leaderHeard = performance.now();
  const stream = () => {
    leading = true;
    return new Promise(() => streamForEver()); // the lock is held until the tab closes or another takes it
  };
  if (!navigator.locks) return void stream();
  try {
    await navigator.locks.request(LOCK, { steal }, stream);
  } catch {
    leading = false; // taken by another tab, as this one was silent
    control?.abort();
    lead();
  }
}

async function streamForEver() {
  while (leading) {
    control = new AbortController();
    const { signal } = control;
    let wait_ms = AGAIN_MS;
    let beat = performance.now();
    const watch = setInterval(() => performance.now() - beat > SILENT_MS && control.abort(), 1000);
    const heard = (message) => {
      beat = performance.now();
      if (message) pass(message);
    };
    try {
      await Promise.race([followLive(signal, heard), followEvents(signal)]);
    } catch (error) {
      if (error instanceof Response) {
        if (error.status === 401) wait_ms = UNKNOWN_AGAIN_MS;
        else pass({ kind: 'refused', problem: await problemOf(error) });
      } else pass({ kind: 'silent' });
    } finally {
      clearInterval(watch);
      control.abort();
    }
    await new Promise((resolve) => {
      wake = resolve;
      setTimeout(resolve, wait_ms);
    });
  }
}

function followLive(signal, heard) {
  return followStream('/live', {
    signal,
    take: ({ kind, data }) => {
      if (data) last = { kind: 'live', data: { ...last?.data, ...data } };
      heard(kind && data ? { kind: 'live', data } : null);
    },
  });
}

/** From the event that was the last when the session was asked for, so that nothing is missed between the first answers and this stream. */
async function followEvents(signal) {
  const { last_event_id: first } = await known(now.session);
  const after = lastEvent || String(first ?? '');
  await followStream('/events', {
    signal,
    headers: after ? { 'Last-Event-ID': after } : {},
    take: ({ kind, id, data }) => {
      lastEvent = id || lastEvent;
      if (kind) pass({ kind: 'event', event: kind, data });
    },
  });
}

/** The first value of the signal that is not null. */
function known(signal) {
  return new Promise((resolve) => {
    const stop = signal.subscribe((value) => value !== null && queueMicrotask(() => {
      stop();
      resolve(value);
    }));
  });
}

async function problemOf(response) {
  const { problem, status } = await refusal(response);
  return { status, ...problem };
}
