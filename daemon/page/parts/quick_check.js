// The quick check: the arm looks at the target again, and compares with the active calibration.
import { html } from '../vendor/preact.js';
import { ask } from '../state/ask.js';
import { may, note, running } from '../state/now.js';
import { go } from '../state/place.js';
import { camera, cameraNamed, readyWith } from '../state/sensors.js';
import { t } from '../state/words.js';
import { HoldButton } from './hold_button.js';

/** `off`: also while there is nothing to compare with. `primary`: the main thing to do on its screen. */
export function QuickCheck({ off = false, primary = false }) {
  const begin = async (key) => {
    const { data } = await ask('/verify', { method: 'POST', body: cameraNamed(camera.value), key });
    note('run');
    go('run', data.id);
  };
  const disabled = off || !may('operator') || running.value || !readyWith()?.calibrate?.ready;
  return html`<${HoldButton} id="hold-verify" primary=${primary} label=${t('verify.start')} act=${begin} disabled=${disabled} why=${t(may('operator') ? 'verify.not-yet' : 'missing.role')} />`;
}
