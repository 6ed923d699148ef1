// The camera's stream, split into pictures however it is cut.
import assert from 'node:assert/strict';
import test from 'node:test';
import { PartReader, pictureOf } from '../../../../daemon/page/state/pictures.js';

const encode = (text) => new TextEncoder().encode(text);
const LOOK = { size: [960, 600], of: 88, corners: [[0, 12.5, 8.25]] };
const JPEG = Uint8Array.from([0xff, 0xd8, 13, 10, 13, 10, 45, 45, 0xff, 0xd9]); // with what ends a head in it

function part(headers, body) {
  const lines = Object.entries({ ...headers, 'Content-Length': body.length }).map(([name, value]) => `${name}: ${value}\r\n`);
  return [...encode(`${lines.join('')}\r\n`), ...body, ...encode('\r\n--handeyed-picture\r\n')];
}

const STREAM = Uint8Array.from([
  ...encode('--handeyed-picture\r\n'),
  ...part({ 'Content-Type': 'image/jpeg', 'Handeyed-Picture': 7, 'Handeyed-Age-S': '0.125', 'Handeyed-Look': JSON.stringify(LOOK) }, JPEG),
  ...part({ 'Content-Type': 'application/problem+json' }, encode('{"code":"device-unreachable","detail":"camera: off"}')),
  ...part({ 'Content-Type': 'image/jpeg', 'Handeyed-Picture': 9, 'Handeyed-Age-S': '2.000' }, JPEG),
]);

test('a stream is the same pictures however its bytes come', async () => {
  for (const step of [1, 2, 3, 7, 64, STREAM.length]) {
    const reader = new PartReader();
    const pictures = [];
    for (let at = 0; at < STREAM.length; at += step) pictures.push(...reader.take(STREAM.subarray(at, at + step)).map(pictureOf));
    const [first, problem, last] = pictures;
    assert.equal(pictures.length, 3);
    assert.deepEqual([first.number, first.age_s, first.look], [7, 0.125, LOOK]);
    assert.deepEqual(new Uint8Array(await first.file.arrayBuffer()), JPEG);
    assert.deepEqual(problem, { problem: { code: 'device-unreachable', detail: 'camera: off' } });
    assert.deepEqual([last.number, last.age_s, last.look], [9, 2, null]);
  }
});
