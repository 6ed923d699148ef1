// A screen, hidden until its first answers and the state of the cell are there, for ten seconds at most; then shown for good.
import { html, useEffect, useLayoutEffect, useRef, useState } from '../vendor/preact.js';
import { awaited } from '../state/arrival.js';
import { heardAt, lost, ready, refused, session } from '../state/now.js';
import { t } from '../state/words.js';

const MAX_HIDDEN_MS = 10000;

/** `onWhole()`: told when it is shown; `quiet`: nothing says that one waits, as something else is shown meanwhile. */
export function Whole({ children, quiet = false, onWhole }) {
  const [drawn, setDrawn] = useState(false); // the screen has asked what it asks at first
  const [late, setLate] = useState(false);
  const arrived = useRef(false);
  useLayoutEffect(() => {
    setDrawn(true); // after the layout effects of all children
    const timer = setTimeout(() => setLate(true), MAX_HIDDEN_MS);
    return () => clearTimeout(timer);
  }, []);
  const heard = heardAt.value !== null && ready.value !== null; // the first words may come before the devices were asked
  const told = heard || lost.value || refused.value !== null || session.value.role === 'nobody';
  arrived.current ||= (!awaited() && told && drawn) || late;
  useEffect(() => {
    if (arrived.current) onWhole?.();
  }, [arrived.current]);
  return html`${!arrived.current && !quiet && html`<p class="quiet soon">${t('missing.wait')}</p>`}
    <div class=${arrived.current ? '' : 'arriving'}>${children}</div>`;
}
