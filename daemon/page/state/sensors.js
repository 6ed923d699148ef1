// Which camera and which scanner of the cell the screens show and drive: the first ones until another is chosen in this tab.
import { computed, signal } from '../vendor/preact.js';
import { ready, readyOf } from './now.js';

const MAIN = { camera: 'camera', scanner: 'scanner' };

export const cameras = signal([]); // names, the first one of the settings first
export const scanners = signal([]); // { name, camera, poses }

/** Takes the names from an answer of GET /arm. */
export function noteSensors(arm) {
  cameras.value = arm.cameras;
  scanners.value = arm.scanners;
}

function chosenOf(names, main) {
  const wanted = signal(null);
  const chosen = computed(() => (names().includes(wanted.value) ? wanted.value : (names()[0] ?? main)));
  return [chosen, (name) => (wanted.value = name)];
}

export const [camera, chooseCamera] = chosenOf(() => cameras.value, MAIN.camera);
export const [scanner, chooseScanner] = chosenOf(() => scanners.value.map(({ name }) => name), MAIN.scanner);

/** What a request says of the camera `name`: nothing for the first one. */
export const cameraNamed = (name) => (name === MAIN.camera ? {} : { camera: name });
export const scannerNamed = (name) => (name === MAIN.scanner ? {} : { scanner: name });

/** `path` of a GET for the camera `name`, by default the chosen one. */
export function ofCamera(path, name = camera.value) {
  if (name === MAIN.camera) return path;
  return `${path}${path.includes('?') ? '&' : '?'}camera=${encodeURIComponent(name)}`;
}

/** The camera of a run or of what asked for one. */
export const cameraOf = (run) => run?.request?.camera ?? MAIN.camera;

/** Whether a run with the camera `name`, by default the chosen one, may start, and why not; null while that is not known. */
export const readyWith = (name = camera.value) => (name === MAIN.camera ? ready.value : (readyOf.value[name] ?? null));
