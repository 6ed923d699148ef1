// What the camera sees, with the corners found in just this picture: a stream that is open while somebody looks at it.
import { html, useEffect, useState } from '../vendor/preact.js';
import { refusal } from '../state/ask.js';
import { clock, linked, lost } from '../state/now.js';
import { count } from '../state/numbers.js';
import { followPictures } from '../state/pictures.js';
import { camera, ofCamera } from '../state/sensors.js';
import { useVisible } from '../state/visible.js';
import { t } from '../state/words.js';
import { Picture } from './picture.js';
import { Cause } from './problem.js';

const AGAIN_MS = 1000;
const OLD_S = 1;
const NOTHING = { src: null, number: null, size: undefined, look: null, seen: null, taken: 0, problem: null };

/** `of`: name of the camera, by default the chosen one. `onSeen(look)`: told of each look for the target, null before the first. `belongs`: of Picture. */
export function LivePicture({ of = camera.value, onSeen, belongs }) {
  const [shown, setShown] = useState(NOTHING);
  const visible = useVisible();
  useEffect(() => {
    if (!visible) return undefined;
    const control = new AbortController();
    let held = null;
    const take = async ({ problem, file, number, age_s, look }) => {
      if (problem) return void setShown((before) => ({ ...before, problem }));
      const taken = performance.now() - 1000 * age_s;
      const image = new Image();
      image.src = URL.createObjectURL(file);
      await image.decode(); // before it is shown: the last one stays until then
      if (control.signal.aborted) return void URL.revokeObjectURL(image.src);
      if (held) URL.revokeObjectURL(held);
      held = image.src;
      const size = look?.size ?? [image.naturalWidth, image.naturalHeight];
      setShown(({ seen }) => ({ src: held, number, size, look, seen: look ?? seen, taken, problem: null }));
    };
    follow(ofCamera('/camera/stream?width=480', of), control.signal, take);
    return () => {
      control.abort();
      if (held) URL.revokeObjectURL(held);
    };
  }, [of, visible, linked.value]);
  useEffect(() => onSeen?.(shown.seen), [shown.seen]);
  const words = seenWords(shown.seen);
  const age_s = shown.src ? (Math.max(clock.value, performance.now()) - shown.taken) / 1000 : 0;
  const aged = age_s > OLD_S ? t('picture.age', { s: count(Math.floor(age_s)) }) : '';
  return html`<${Picture} src=${shown.src} number=${shown.number} size=${shown.size} corners=${shown.look?.corners ?? []} belongs=${shown.src && belongs} alt=${`${t('picture.camera')} ${words}`} dim=${lost.value} />
    ${shown.problem && !lost.value ? html`<${Cause} cause=${{ ...shown.problem, what: shown.problem.detail }} />` : html`<p class="one-line"><span role="status">${words}</span> ${aged && html`<span class="quiet">${aged}</span>`}</p>`}`;
}

/** Follow the stream, and again whenever it ends, until `signal`. */
async function follow(path, signal, take) {
  while (!signal.aborted) {
    try {
      await followPictures(path, { signal, take });
    } catch (error) {
      if (error instanceof Response && !signal.aborted) take({ problem: (await refusal(error)).problem });
    }
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
  }
}

export function seenWords(seen) {
  if (!seen) return '';
  if (!seen.corners?.length) return `✕ ${t('look.none')}`;
  return `✓ ${t('look.corners', { count: count(seen.corners.length), of: count(seen.of) })}`;
}
