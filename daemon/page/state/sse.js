// Server-sent events out of a fetch stream, which can say why it was refused and can be given up (pure but for the reader).

/** Splits text into events; keeps what is not complete yet. */
export class EventReader {
  #rest = '';

  /** The events completed by `text`: [{ kind, id, data }]; data as JSON. Comments are events of the kind "". */
  take(text) {
    const parts = (this.#rest + text).replaceAll('\r\n', '\n').split('\n\n');
    this.#rest = parts.pop();
    return parts.map(eventOf);
  }
}

function eventOf(block) {
  const event = { kind: '', id: '', data: null };
  let data = '';
  for (const line of block.split('\n')) {
    const [, name, value] = /^([a-z]*): ?(.*)$/.exec(line) ?? [];
    if (name === 'event') event.kind = value;
    else if (name === 'id') event.id = value;
    else if (name === 'data') data += value;
  }
  if (data) {
    event.data = JSON.parse(data);
    event.kind ||= 'message';
  }
  return event;
}

/** Calls `take` with each event of the stream at `path` until it ends. Throws what fetch throws, or the response. */
export async function followStream(path, { headers = {}, signal, take }) {
  const response = await fetch(path, { headers: { Accept: 'text/event-stream', ...headers }, signal, cache: 'no-store' });
  if (!response.ok) throw response;
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  const events = new EventReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    for (const event of events.take(value)) take(event);
  }
}
