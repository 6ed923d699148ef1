// Something asked of the daemon, asked anew when one of the events it depends on comes.
import { html, useCallback, useEffect, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { changed, heardAt, session } from '../state/now.js';
import { t } from '../state/words.js';
import { ProblemNote } from './problem.js';

/** { data, etag, error, again } of a GET; `path` null asks nothing. `kinds`: events after which it is asked anew. */
export function useAsked(path, kinds = []) {
  const [state, setState] = useState({ data: null, etag: null, error: null, path: null });
  const [turn, setTurn] = useState(0);
  const happened = kinds.map((kind) => changed.value[kind] ?? 0).join();
  const linked = heardAt.value !== null;
  useEffect(() => {
    let wanted = true;
    if (path) {
      ask(path).then(
        ({ data, etag }) => wanted && setState({ data, etag, error: null, path }),
        (error) => wanted && setState((before) => ({ ...before, data: before.path === path ? before.data : null, error, path })),
      );
    }
    return () => {
      wanted = false;
    };
  }, [path, happened, turn, linked, session.value?.role]);
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
