// Requests to the daemon: JSON in and out; every refusal is a `Refused` with what, fix, code and the request's id.

export class Refused extends Error {
  constructor(status, problem, requestId) {
    super(problem.detail ?? '');
    Object.assign(this, { status, problem, requestId, code: problem.code ?? '' });
  }
}

export const LINK_LOST = 'link-lost';

export function newKey() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** The answer of the daemon as { data, etag, status }. Throws Refused, with code LINK_LOST when there was no answer. */
export async function ask(path, { method = 'GET', body, key, headers = {}, limit_s = 20, kind = 'json' } = {}) {
  const given = { Accept: 'application/json', ...headers };
  if (key) given['Idempotency-Key'] = key;
  if (body !== undefined && !(body instanceof Blob)) {
    given['Content-Type'] = 'application/json';
    body = JSON.stringify(body);
  }
  let response;
  try {
    const signal = AbortSignal.timeout(limit_s * 1000);
    response = await fetch(path, { method, headers: given, body, signal, cache: 'no-cache', redirect: 'error' });
    if (response.ok) {
      const data = await read(response, kind);
      return { data, etag: response.headers.get('ETag'), status: response.status };
    }
  } catch (error) {
    throw new Refused(0, { code: LINK_LOST, detail: String(error?.message ?? error) }, '');
  }
  throw await refusal(response);
}

async function read(response, kind) {
  if (response.status === 204) return null;
  return kind === 'json' ? response.json() : kind === 'bytes' ? response.arrayBuffer() : response.blob();
}

export async function refusal(response) {
  let problem = {};
  try {
    problem = await response.json();
  } catch {
    problem = { code: `http-${response.status}`, detail: response.statusText };
  }
  return new Refused(response.status, problem, response.headers.get('X-Request-Id') ?? '');
}
