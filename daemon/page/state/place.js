// The place shown, from the address: #/result/ID is the screen "result" with the argument ID.
import { signal } from '../vendor/preact.js';

/** { screen, argument } of a fragment such as "#/result/20261122-1". */
export function placeOf(hash) {
  const [screen = '', ...rest] = hash.replace(/^#\/?/, '').split('/');
  let argument = rest.join('/');
  try {
    argument = decodeURIComponent(argument);
  } catch {
    // not an encoded text: shown as it is
  }
  return { screen: screen || 'cell', argument };
}

export const place = signal(placeOf(location.hash));
addEventListener('hashchange', () => {
  place.value = placeOf(location.hash);
});

export const linkTo = (screen, argument = '') => `#/${screen}${argument === '' ? '' : `/${encodeURIComponent(argument)}`}`;

export function go(screen, argument = '') {
  location.hash = linkTo(screen, argument);
}
