// Somebody at the screen keeps the session an operator's.
import { useEffect } from '../vendor/preact.js';
import { ask } from './ask.js';
import { session } from './now.js';
import { loadSession } from './session.js';

/** Sends that somebody is there, once a minute at most. */
export function useTouch() {
  useEffect(() => {
    let said = 0;
    const touch = () => {
      if (!session.value?.expires_at || performance.now() - said < 60_000) return;
      said = performance.now();
      ask('/session/touch', { method: 'POST' }).then(loadSession, () => {});
    };
    addEventListener('pointerdown', touch);
    addEventListener('keydown', touch);
    return () => {
      removeEventListener('pointerdown', touch);
      removeEventListener('keydown', touch);
    };
  }, []);
}
