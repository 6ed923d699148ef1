// What the camera sees, with the corners found, asked anew every two seconds while it is looked at and nothing runs.
import { html, useEffect, useState } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { lost, look, run, running } from '../state/now.js';
import { count } from '../state/numbers.js';
import { camera, ofCamera } from '../state/sensors.js';
import { t } from '../state/words.js';
import { Picture } from './picture.js';
import { Cause } from './problem.js';

const EVERY_MS = 2000;

/** `of`: name of the camera, by default the chosen one. */
export function LivePicture({ of = camera.value }) {
  const [shown, setShown] = useState({ src: null, look: null, turn: 0 });
  const manual = run.value?.request?.manual && running.value;
  useEffect(() => {
    let wanted = true;
    let timer = 0;
    let held = null;
    const next = async () => {
      if (!document.hidden && !lost.value) {
        try {
          const seen = manual ? null : (await ask(ofCamera('/camera/look', of))).data;
          const { data } = await ask(ofCamera('/camera/frame?width=960', of), { kind: 'blob', headers: { Accept: 'image/jpeg' } });
          const url = URL.createObjectURL(data);
          if (!wanted) return void URL.revokeObjectURL(url);
          if (held) URL.revokeObjectURL(held);
          held = url;
          setShown({ src: url, look: seen, error: null });
        } catch (error) {
          if (wanted) setShown((before) => ({ ...before, error }));
        }
      }
      if (wanted) timer = setTimeout(next, EVERY_MS);
    };
    next();
    return () => {
      wanted = false;
      clearTimeout(timer);
      if (held) URL.revokeObjectURL(held);
    };
  }, [manual, of]);
  const seen = manual ? look.value : shown.look;
  const words = seenWords(seen);
  return html`<${Picture} src=${shown.src} size=${seen?.size ?? undefined} corners=${seen?.corners ?? []} alt=${`${t('picture.camera')} ${words}`} dim=${lost.value} />
    ${shown.error && !lost.value ? html`<${Cause} cause=${{ ...shown.error.problem, code: shown.error.code, what: shown.error.message }} />` : html`<p class="one-line" role="status">${words}</p>`}`;
}

export function seenWords(seen) {
  if (!seen) return '';
  if (!seen.corners?.length) return `✕ ${t('look.none')}`;
  return `✓ ${t('look.corners', { count: count(seen.corners.length), of: count(seen.of) })}`;
}
