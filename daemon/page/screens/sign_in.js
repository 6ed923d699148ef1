// First run and signing in: what is asked for, the first key shown once, codes for tablets, this device's choices.
import { html, useState } from '../vendor/preact.js';
import { Card, Facts } from '../parts/card.js';
import { Choices } from '../parts/choices.js';
import { ProblemNote } from '../parts/problem.js';
import { Act } from '../parts/act.js';
import { ask } from '../state/ask.js';
import { moment } from '../state/numbers.js';
import { may, session } from '../state/now.js';
import { go, linkTo, place } from '../state/place.js';
import { signIn, signOut } from '../state/session.js';
import { t } from '../state/words.js';

export function SignIn() {
  const { asked, role } = session.value;
  const [made, setMade] = useState(null);
  return html`<div class="grid narrow">
    ${made ? html`<${FirstKey} made=${made} />`
      : asked === 'setup-code' ? html`<${SetUp} done=${setMade} />`
      : role !== 'nobody' ? html`<${Person} />`
      : html`<${Ask} />`}
    <${Choices} />
  </div>`;
}

function Ask() {
  const [problem, setProblem] = useState(null);
  const [text, setText] = useState('');
  const submit = async (event) => {
    event.preventDefault();
    setProblem(null);
    const given = text.trim();
    try {
      await signIn(given.startsWith('hek_') ? { key: given } : { code: given });
      if (place.value.screen === 'sign-in') go('cell');
    } catch (error) {
      setProblem(error);
      setText('');
    }
  };
  return html`<${Card} title=${t('sign-in.title')} id="ask">
    <p>${t('sign-in.why')}</p>
    <form onSubmit=${submit}>
      <label for="key">${t('sign-in.label')}</label>
      <input id="key" type="password" autocomplete="off" spellcheck="false" required value=${text} onInput=${(event) => setText(event.target.value)} aria-describedby="key-how" />
      <p id="key-how" class="small quiet">${t('sign-in.how')}</p>
      <button type="submit" class="primary">${t('sign-in')}</button>
    </form>
    ${problem && html`<${ProblemNote} problem=${problem} />`}
  </${Card}>`;
}

function SetUp({ done }) {
  const [problem, setProblem] = useState(null);
  const submit = async (event) => {
    event.preventDefault();
    setProblem(null);
    const form = new FormData(event.target);
    try {
      const body = { code: form.get('code').trim(), name: form.get('name').trim() };
      const { data } = await ask('/setup', { method: 'POST', body });
      done(data);
    } catch (error) {
      setProblem(error);
    }
  };
  return html`<${Card} title=${t('setup.title')} id="setup">
    <p>${t('setup.why')}</p>
    <form onSubmit=${submit}>
      <label for="code">${t('setup.code')}</label>
      <input id="code" name="code" autocomplete="off" spellcheck="false" required aria-describedby="code-how" />
      <p id="code-how" class="small quiet">${t('setup.how')}</p>
      <label for="name">${t('setup.name')}</label>
      <input id="name" name="name" autocomplete="off" required maxlength="60" />
      <button type="submit" class="primary">${t('setup.make')}</button>
    </form>
    ${problem && html`<${ProblemNote} problem=${problem} />`}
  </${Card}>`;
}

function FirstKey({ made }) {
  const [problem, setProblem] = useState(null);
  const use = async () => {
    try {
      await signIn({ key: made.key });
      go('cell');
    } catch (error) {
      setProblem(error);
    }
  };
  return html`<${Card} title=${t('first-key.title', { name: made.name })} id="first-key">
    <p>${t('first-key.once')}</p>
    <output class="key">${made.key}</output>
    <div class="row"><button type="button" onClick=${() => print()}>${t('first-key.print')}</button>
    <button type="button" class="primary" onClick=${use}>${t('first-key.use')}</button></div>
    ${problem && html`<${ProblemNote} problem=${problem} />`}
  </${Card}>`;
}

function Person() {
  const { name, role, expires_at, asked } = session.value;
  const [code, setCode] = useState(null);
  return html`<${Card} title=${t('person.title')} id="person">
    <${Facts} rows=${[
      [t('person.name'), name], [t('person.role'), html`${t(`role.${role}`)} <span class="quiet">${t(`role.${role}.may`)}</span>`],
      expires_at && [t('person.until'), moment(expires_at)],
    ]} />
    ${asked === 'nobody' && html`<p class="note info">${t('person.nobody-asked')}</p>`}
    <div class="row">
      <a class="button" href=${linkTo('cell')}>${t('person.cell')}</a>
      ${expires_at && html`<${Act} label=${t('person.out')} act=${signOut} />`}
      ${expires_at && may('operator') && html`<${Act} label=${t('pair.make')} act=${async () => setCode((await ask('/session/pairing', { method: 'POST', body: {} })).data)} />`}
    </div>
    ${code && html`<p>${t('pair.type')}</p><output class="key">${code.code}</output><p class="small quiet">${t('pair.until', { at: moment(code.expires_at) })}</p>`}
  </${Card}>`;
}
