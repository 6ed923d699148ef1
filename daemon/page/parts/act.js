// A button that does something at once: busy while it does, the refusal beside it.
import { html, useState } from '../vendor/preact.js';
import { lost } from '../state/now.js';
import { ProblemNote } from './problem.js';

export function Act({ label, act, primary = false, disabled = false }) {
  const [busy, setBusy] = useState(false);
  const [problem, setProblem] = useState(null);
  const off = disabled || busy || lost.value;
  const press = async () => {
    if (off) return;
    setBusy(true);
    setProblem(null);
    try {
      await act();
    } catch (error) {
      setProblem(error);
    }
    setBusy(false);
  };
  return html`<div class="act"><button type="button" class=${primary ? 'primary' : ''} aria-disabled=${off ? 'true' : undefined} onClick=${press}>${label}</button>
    ${problem && html`<${ProblemNote} problem=${problem} />`}</div>`;
}
