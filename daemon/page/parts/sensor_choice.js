// The camera or scanner that a screen shows, by name, where a cell has several of them.
import { html, useEffect } from '../vendor/preact.js';
import { camera, cameras, chooseCamera, chooseScanner, noteSensors, scanner, scanners } from '../state/sensors.js';
import { deviceName, t } from '../state/words.js';
import { useAsked } from './loaded.js';

const CAMERA = { names: () => cameras.value, chosen: camera, choose: chooseCamera, label: 'device.name.camera' };
const SCANNER = { names: () => scanners.value.map(({ name }) => name), chosen: scanner, choose: chooseScanner, label: 'device.name.scanner' };
const OF_SCREEN = { cell: CAMERA, calibrate: CAMERA, result: CAMERA, verify: CAMERA, jog: CAMERA, scans: SCANNER };

/** Nothing for a cell with one of them, and where the sensor is that of what is shown, as it is `named` in the address. */
export function SensorChoice({ screen, named }) {
  const of = OF_SCREEN[screen];
  const arm = useAsked(of ? '/arm' : null);
  useEffect(() => {
    if (arm.data) noteSensors(arm.data);
  }, [arm.data]);
  if (!of || named || of.names().length < 2) return null;
  const label = t(of.label);
  return html`<div class="chips sensors" role="group" aria-label=${label}><span class="small quiet" aria-hidden="true">${label}</span>
    <div class="row">${of.names().map((name) => html`<button type="button" class="chip" key=${name} aria-pressed=${name === of.chosen.value} onClick=${() => of.choose(name)}>${deviceName(name)}</button>`)}</div></div>`;
}
