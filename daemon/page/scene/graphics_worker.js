// Asks for a context of WebGL, which starts the browser's graphics process.
try {
  new OffscreenCanvas(1, 1).getContext('webgl2');
} finally {
  postMessage('started');
}
