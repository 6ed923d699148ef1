// How many first answers a screen still waits for: it is shown whole when they are there, so that nothing jumps.
import { signal } from '../vendor/preact.js';

const held = signal(0);

/** Whether an answer is awaited. */
export const awaited = () => held.value > 0;

/** Count one answer more until the returned function is called, once or more often. */
export function hold() {
  held.value = held.peek() + 1;
  let holding = true;
  return () => {
    if (holding) held.value = held.peek() - 1;
    holding = false;
  };
}
