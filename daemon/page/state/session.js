// Who is signed in: a key or a code is exchanged for a cookie that scripts cannot read.
import { ask } from './ask.js';
import { askAnew } from './live.js';
import { session } from './now.js';

export async function loadSession() {
  session.value = (await ask('/session')).data;
  return session.value;
}

/** Sign in by { key } or { code }. Throws Refused. */
export async function signIn(given) {
  await ask('/session', { method: 'POST', body: given });
  await loadSession();
  askAnew();
}

export async function signOut() {
  await ask('/session', { method: 'DELETE' });
  await loadSession();
  askAnew();
}
