// The arm moves to a pose while this button is held, and stands when it is let go. The page says ten times a second that it is
// held; the daemon stops the arm when it hears nothing for 0.3 s. A web page is no enabling device.
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { ask, newKey } from '../state/ask.js';
import { lost, note, old } from '../state/now.js';
import { t } from '../state/words.js';
import { ProblemNote } from './problem.js';

const HOLD_MS = 1000; // before anything moves, as for every button that moves the arm
const SAY_MS = 100;
const SAY_LIMIT_S = 1;
const ARRIVES_LIMIT_S = 600; // within a run by hand the answer comes when the arm stands
const LET_GO_LIMIT_MS = 5000; // the daemon forgets a button that was never held after 1 s
const MOST_WORDS = 3; // on the way at once: an answer that is late holds up no later word

const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/**
 * What a button needs that moves the arm to `to` (base_T_flange) while it is held: its state ('idle', 'holding' for a second,
 * 'moving'), whether it is off, and as what is shown is old, what went wrong, and what to listen to.
 * `speed_mm_s`: as the daemon does by itself where it is left out. `within`: id of a run by hand in which the arm moves, a run of its own without; `began(id)` is told that run, `onHeld(held)`
 * whether the button is held.
 */
export function useHeld({ to, speed_mm_s, within, began, onHeld, disabled }) {
  const stale = lost.value || old.value;
  const off = disabled || stale || !to;
  const [state, setState] = useState('idle'); // idle, holding (for a second), moving
  const [problem, setProblem] = useState(null);
  const held = useRef(null); // the hold in progress: { name, since, path, heard, saying, timer }

  const say = (one, released = false) => {
    const body = { hold: one.name, at_s: (performance.now() - one.since) / 1000, released };
    return ask(`/runs/${encodeURIComponent(one.path)}/hold`, { method: 'POST', body, limit_s: SAY_LIMIT_S });
  };
  const letGo = () => {
    const one = held.current;
    held.current = null;
    if (!one) return;
    clearTimeout(one.timer);
    if (one.path) sayReleased(one);
    setState('idle');
    onHeld?.(false);
  };
  const sayReleased = async (one) => {
    for (const until = performance.now() + LET_GO_LIMIT_MS; performance.now() < until && !one.over; await pause(SAY_MS)) {
      try {
        return await say(one, true);
      } catch (error) {
        if (one.heard || error.code !== 'not-held') return undefined; // not heard: the daemon stops the arm by itself
      }
    }
    return undefined;
  };
  const goOn = async (one) => {
    while (held.current === one) {
      if (one.saying < MOST_WORDS) sayOn(one);
      await pause(SAY_MS);
    }
  };
  const sayOn = async (one) => {
    one.saying += 1;
    try {
      await say(one);
      one.heard = true;
    } catch (error) {
      if (held.current === one && error.code !== 'not-held') setProblem(error);
      if (held.current === one && (one.heard || error.code !== 'not-held')) letGo(); // it arrived, or was stopped
    }
    one.saying -= 1;
  };
  const arrived = (one) => held.current === one && letGo();
  const move = async (one) => {
    setState('moving');
    try {
      const path = within ? `/runs/${encodeURIComponent(within)}/jog` : '/robot/jog';
      const asked = ask(path, { method: 'POST', key: newKey(), body: { to, hold: one.name, speed_mm_s }, limit_s: within && ARRIVES_LIMIT_S });
      one.path = within ?? (await asked).data.id;
      began?.(one.path);
      if (held.current === one) await (within ? Promise.all([asked.then(() => arrived(one)), goOn(one)]) : goOn(one));
      else sayReleased(one);
    } catch (error) {
      setProblem(error);
    }
    one.over = Boolean(within);
    note('run');
    if (held.current === one) letGo();
  };
  const begin = () => {
    if (off || held.current) return;
    setProblem(null);
    setState('holding');
    const one = { name: newKey(), since: performance.now(), path: null, heard: false, saying: 0 };
    one.timer = setTimeout(() => move(one), HOLD_MS);
    held.current = one;
    onHeld?.(true);
  };

  useEffect(() => letGo, []);
  useEffect(() => {
    if (off) letGo();
  }, [off]);
  useEffect(() => {
    if (state === 'idle') return undefined;
    // a pointer that is lifted over something that came between counts as well: the button itself hears nothing of it
    const watched = [[document, 'visibilitychange'], ...['blur', 'pagehide', 'pointerdown', 'pointerup', 'pointercancel'].map((kind) => [window, kind])];
    const onKey = (event) => event.key === 'Escape' && letGo();
    for (const [where, kind] of watched) where.addEventListener(kind, letGo, true);
    document.addEventListener('keydown', onKey, true);
    return () => {
      for (const [where, kind] of watched) where.removeEventListener(kind, letGo, true);
      document.removeEventListener('keydown', onKey, true);
    };
  }, [state]);
  const onPress = (event) => {
    if (event.button !== 0 || !event.isPrimary) return;
    if (event.currentTarget.hasPointerCapture(event.pointerId)) event.currentTarget.releasePointerCapture(event.pointerId); // a finger that slides off has let go
    begin();
  };
  const onKey = (event) => {
    if (event.key !== 'Enter' && event.key !== ' ') return;
    event.preventDefault();
    if (event.type === 'keyup') letGo();
    else if (!event.repeat) begin();
  };
  const listen = {
    onPointerDown: onPress, onPointerUp: letGo, onPointerCancel: letGo, onPointerLeave: letGo, onBlur: letGo, onKeyDown: onKey, onKeyUp: onKey,
    onContextMenu: (event) => event.preventDefault(),
  };
  return { state, off, stale, problem, listen };
}

export function HeldMove({ to, speed_mm_s, within, began, onHeld, label, primary = false, disabled = false, why = '', id }) {
  const { state, off, stale, problem, listen } = useHeld({ to, speed_mm_s, within, began, onHeld, disabled });
  const said = { idle: t('held.idle'), holding: t('hold.on'), moving: t('held.moving') };
  return html`<div class="hold">
    <button type="button" id=${id} class="hold-button moves ${primary ? 'primary' : ''} ${state}" aria-disabled=${off ? 'true' : undefined} aria-describedby=${id && `${id}-how`} ...${listen}>
      <span class="fill" aria-hidden="true"></span><span class="label">${label}</span>
    </button>
    <p class="quiet" id=${id && `${id}-how`} role="status">${stale ? t('hold.stale') : off && why ? why : said[state]}</p>
    ${problem && html`<${ProblemNote} problem=${problem} />`}
  </div>`;
}
