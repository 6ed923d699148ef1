// What moves the arm is held for a second. One Idempotency-Key an act: made with the button, kept until an answer comes.
import { html, useEffect, useRef, useState } from '../vendor/preact.js';
import { LINK_LOST, newKey } from '../state/ask.js';
import { lost, old } from '../state/now.js';
import { t } from '../state/words.js';
import { ProblemNote } from './problem.js';

const HOLD_MS = 1000;
const SWITCH_MS = [3000, 10000]; // two presses this far apart, for people who cannot hold

/** `act(key)` after a hold of a second by finger, mouse, Enter or Space; or by two presses 3 s apart. */
export function HoldButton({ act, label, moves = true, primary = false, disabled = false, why = '', id }) {
  const key = useRef(newKey());
  const timer = useRef(0);
  const pressed = useRef(0);
  const [state, setState] = useState('idle'); // idle, holding, armed, sending
  const [problem, setProblem] = useState(null);
  const stale = lost.value || old.value;
  const off = disabled || stale || state === 'sending';

  const end = () => {
    clearTimeout(timer.current);
    setState((now) => (now === 'holding' ? 'idle' : now));
  };
  useEffect(() => () => clearTimeout(timer.current), []);
  useEffect(() => {
    if (off) end();
  }, [off]);

  const send = async () => {
    setState('sending');
    setProblem(null);
    try {
      await act(key.current);
      key.current = newKey();
    } catch (error) {
      if (error.code !== LINK_LOST) key.current = newKey();
      setProblem(error);
    }
    setState('idle');
  };
  const begin = () => {
    if (off) return;
    clearTimeout(timer.current);
    setState('holding');
    timer.current = setTimeout(send, HOLD_MS);
  };
  const onKey = (event) => {
    if (event.key !== 'Enter' && event.key !== ' ') return;
    event.preventDefault();
    if (event.type === 'keyup') end();
    else if (!event.repeat) begin();
  };
  const onPointer = (event) => {
    if (event.button !== 0) return;
    event.currentTarget.setPointerCapture(event.pointerId);
    begin();
  };
  const onClick = (event) => {
    if (event.detail !== 0 || off) return; // a click of a mouse, not of a switch or a screen reader
    const since = performance.now() - pressed.current;
    if (state === 'armed' && since >= SWITCH_MS[0] && since <= SWITCH_MS[1]) return void send();
    if (state === 'armed' && since < SWITCH_MS[0]) return;
    pressed.current = performance.now();
    setState('armed');
    setTimeout(() => setState((now) => (now === 'armed' ? 'idle' : now)), SWITCH_MS[1]);
  };
  const said = { idle: t(moves ? 'hold.moves' : 'hold.act'), holding: t('hold.on'), armed: t('hold.again'), sending: t('hold.sent') };
  return html`<div class="hold">
    <button type="button" id=${id} class="hold-button ${moves ? 'moves' : ''} ${primary ? 'primary' : ''} ${state}" aria-disabled=${off ? 'true' : undefined}
      aria-describedby=${id && `${id}-how`}
      onPointerDown=${onPointer} onPointerUp=${end} onPointerCancel=${end} onLostPointerCapture=${end} onBlur=${end}
      onKeyDown=${onKey} onKeyUp=${onKey} onClick=${onClick} onContextMenu=${(event) => event.preventDefault()}>
      <span class="fill" aria-hidden="true"></span><span class="label">${label}</span>
    </button>
    <p class="quiet" id=${id && `${id}-how`} role="status">${state === 'sending' ? said.sending : stale ? t('hold.stale') : off && why ? why : said[state]}</p>
    ${problem && html`<${ProblemNote} problem=${problem} />`}
  </div>`;
}
