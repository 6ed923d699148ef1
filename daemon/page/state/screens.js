// The screens that were fetched: whoever shows one is drawn anew when it comes, whoever asked for it.
import { signal } from '../vendor/preact.js';

const AGAIN_MS = 1000;

/** `get(name)`: the component of a screen, or null until it is there; `fetch(name)` asks again each second while the daemon does not answer. */
export function createScreens(sources) {
  const fetched = signal({});
  return {
    get: (name) => fetched.value[name] ?? null,
    async fetch(name) {
      while (!fetched.peek()[name]) {
        try {
          const screen = await sources[name]();
          fetched.value = { ...fetched.peek(), [name]: screen };
        } catch {
          await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
        }
      }
    },
  };
}
