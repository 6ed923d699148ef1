// Who asks for the first context of WebGL waits until the browser's graphics process runs: up to a second without a graphics card. A worker waits in the page's place.
const WORKER = new URL('graphics_worker.js', import.meta.url).href;
const LIMIT_MS = 15_000;
const policy = globalThis.trustedTypes?.createPolicy('graphics-worker', { createScriptURL: () => WORKER });

/** Ends when a context of WebGL can be had at once, and when there is no worker that could tell. */
export function graphicsStarted() {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, LIMIT_MS);
    try {
      const worker = new Worker(policy ? policy.createScriptURL('') : WORKER);
      worker.onmessage = worker.onerror = () => {
        clearTimeout(timer);
        worker.terminate();
        resolve();
      };
    } catch {
      clearTimeout(timer);
      resolve();
    }
  });
}
