import assert from 'node:assert/strict';
import { test } from 'node:test';
import { createScreens } from '../../../../daemon/page/state/screens.js';
import { effect } from '../../../../daemon/page/vendor/preact.js';

test('a screen fetched by another appears to who waits for it', async () => {
  const screens = createScreens({ cell: async () => 'Cell', help: async () => 'Help' });
  const seen = [];
  effect(() => seen.push(screens.get('help')));
  for (const name of ['cell', 'help']) await screens.fetch(name);
  assert.equal(seen[0], null);
  assert.equal(seen.at(-1), 'Help');
});

test('a screen is asked for again until the daemon answers', async (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  let asked = 0;
  const screens = createScreens({
    cell: async () => {
      asked += 1;
      if (asked === 1) throw new TypeError('Failed to fetch');
      return 'Cell';
    },
  });
  const fetched = screens.fetch('cell');
  await new Promise((resolve) => setImmediate(resolve));
  context.mock.timers.tick(1000);
  await fetched;
  assert.deepEqual([asked, screens.get('cell')], [2, 'Cell']);
});
