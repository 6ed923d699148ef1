// Something asked of the daemon, asked anew when one of the events it depends on comes.
import { html, useCallback, useEffect, useLayoutEffect, useRef, useState } from '../vendor/preact.js';
import { hold } from '../state/arrival.js';
import { ask } from '../state/ask.js';
import { changed, linked, session } from '../state/now.js';
import { t } from '../state/words.js';
import { ProblemNote } from './problem.js';

const AGAIN_MS = 2000; // what had no answer is asked again

/** { data, etag, error, again } of a GET; `path` null asks nothing. `kinds`: events after which it is asked anew. The screen is not held back for what is `late`. */
export function useAsked(path, kinds = [], { late = false } = {}) {
  const [state, setState] = useState({ data: null, etag: null, error: null, path: null });
  const [turn, setTurn] = useState(0);
  const happened = kinds.map((kind) => changed.value[kind] ?? 0).join();
  const link = state.error?.status === 0 ? linked.value : Math.max(1, linked.value); // the first link changes nothing that was answered
  const release = useRef(() => {});
  useLayoutEffect(() => { // with the drawing itself: an effect comes later, and the screen might count as whole before
    let wanted = true;
    if (path && !late) release.current = hold();
    if (path) {
      ask(path).then(
        ({ data, etag }) => wanted && setState({ data, etag, error: null, path }),
        (error) => wanted && setState((before) => ({ ...before, data: before.path === path ? before.data : null, error, path })),
      );
    }
    return () => {
      wanted = false;
      release.current();
    };
  }, [path, happened, turn, link, session.value?.role]);
  useEffect(() => {
    if (state.path === path) release.current(); // after what is drawn from the answer has asked for more: effects of children come first
  }, [state]);
  useEffect(() => {
    if (state.error?.status !== 0) return undefined;
    const timer = setTimeout(() => setTurn((number) => number + 1), AGAIN_MS);
    return () => clearTimeout(timer);
  }, [state]);
  const again = useCallback(() => setTurn((number) => number + 1), []);
  return { ...state, data: state.path === path ? state.data : null, error: state.path === path ? state.error : null, again };
}

/** What to show instead of data: why there is none, or that it is on its way; null when there is some. */
export function Missing({ asked, none }) {
  if (asked.data && !asked.error) return null;
  if (asked.error?.status === 404 && none) return html`<p class="quiet">${none}</p>`;
  if (asked.error?.status === 403) return html`<p class="quiet">${t('missing.role')}</p>`;
  if (asked.error) return html`<${ProblemNote} problem=${asked.error} again=${asked.again} />`;
  return html`<p class="quiet waiting">${t('missing.wait')}</p>`;
}
