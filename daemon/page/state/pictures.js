// Pictures out of a multipart stream, each with its number, its age and what was found in it (pure but for the reader).
const HEAD_END = [13, 10, 13, 10];

/** Splits bytes into parts; keeps what is not complete yet. */
export class PartReader {
  #rest = new Uint8Array(0);

  /** The parts completed by `bytes`: [{ headers, body }], names of headers in lower case. */
  take(bytes) {
    const all = new Uint8Array(this.#rest.length + bytes.length);
    all.set(this.#rest);
    all.set(bytes, this.#rest.length);
    const parts = [];
    let from = 0;
    for (;;) {
      const end = headEnd(all, from);
      if (end < 0) break;
      const headers = headersOf(new TextDecoder().decode(all.subarray(from, end)));
      const until = end + HEAD_END.length + Number(headers['content-length']);
      if (until > all.length) break;
      parts.push({ headers, body: all.slice(end + HEAD_END.length, until) });
      from = until;
    }
    this.#rest = all.slice(from);
    return parts;
  }
}

function headEnd(bytes, from) {
  for (let at = bytes.indexOf(13, from); at >= 0; at = bytes.indexOf(13, at + 1)) {
    if (HEAD_END.every((byte, offset) => bytes[at + offset] === byte)) return at;
  }
  return -1;
}

function headersOf(text) {
  const lines = text.split('\r\n').map((line) => /^([\w-]+): (.*)$/.exec(line)).filter(Boolean);
  return Object.fromEntries(lines.map(([, name, value]) => [name.toLowerCase(), value]));
}

/** What a part of GET /camera/stream says: { number, age_s, look, file }, `look` null where the target was not searched; or { problem }. */
export function pictureOf({ headers, body }) {
  if (headers['content-type'] !== 'image/jpeg') return { problem: JSON.parse(new TextDecoder().decode(body)) };
  const look = headers['handeyed-look'];
  return {
    number: Number(headers['handeyed-picture']),
    age_s: Number(headers['handeyed-age-s']),
    look: look ? JSON.parse(look) : null,
    file: new Blob([body], { type: 'image/jpeg' }),
  };
}

/** Calls `take` with the newest picture that has come, and waits for it, until the stream at `path` ends. Throws what fetch throws, or the response. */
export async function followPictures(path, { signal, take }) {
  const response = await fetch(path, { signal, cache: 'no-store' });
  if (!response.ok) throw response;
  const reader = response.body.getReader();
  const parts = new PartReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const newest = parts.take(value).at(-1);
    if (newest) await take(pictureOf(newest));
  }
}
