// A file sent with its progress, which fetch does not tell: by XMLHttpRequest, refused as `ask` refuses.
import { LINK_LOST, Refused } from './ask.js';

/** The answer's JSON. `progress(share)` of the bytes sent, from 0 to 1. Throws Refused, with code LINK_LOST when there was no answer. */
export function upload(path, { body, type, key, limit_s = 600, progress }) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', path);
    request.timeout = limit_s * 1000;
    const headers = { Accept: 'application/json', 'Content-Type': type, 'Idempotency-Key': key };
    for (const [name, value] of Object.entries(headers)) request.setRequestHeader(name, value);
    request.upload.onprogress = ({ loaded, total }) => progress(total ? loaded / total : 0);
    const lost = (detail) => () => reject(new Refused(0, { code: LINK_LOST, detail }, ''));
    request.onerror = lost('the connection broke');
    request.ontimeout = lost(`no answer within ${limit_s} s`);
    request.onload = () => {
      const answer = json(request.responseText);
      if (request.status >= 200 && request.status < 300) resolve(answer);
      else reject(new Refused(request.status, answer ?? { code: `http-${request.status}`, detail: request.statusText }, request.getResponseHeader('X-Request-Id') ?? ''));
    };
    request.send(body);
  });
}

function json(text) {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}
