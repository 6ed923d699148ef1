// When the page has nothing else to do.
const MAX_MS = 2000;

/** Ends when nothing is to be drawn or answered, or after MAX_MS. */
export const idle = () => new Promise((resolve) => (window.requestIdleCallback ? requestIdleCallback(resolve, { timeout: MAX_MS }) : setTimeout(resolve, 200)));
