// A picture of the camera with what was found in it. Its place is reserved before it comes.
import { html, useState } from '../vendor/preact.js';
import { significant } from '../state/numbers.js';
import { t } from '../state/words.js';

/** `belongs`: [[u, v] ...] of the frame in which the target is to be. `number`: of a live picture, which changes while the others stay. `corners`: [[id, u, v, du?, dv?] ...] in pixels of `size`; arrows (du, dv) enlarged so that the longest is a twentieth of the width. */
export function Picture({ src, number = null, alt, size = [1920, 1200], corners = [], arrows = false, belongs = null, dim = false }) {
  const [broken, setBroken] = useState(null); // the address that brought no picture
  const [width, height] = size;
  const longest = arrows ? Math.max(0, ...corners.map(([, , , du = 0, dv = 0]) => Math.hypot(du, dv))) : 0;
  const times = longest > 0 ? width / 18 / longest : 0;
  const r = width / 220;
  return html`<figure class="picture ${dim ? 'dimmed' : ''}" data-number=${number}>
    <div class="frame">
      <svg viewBox="0 0 ${width} ${height}" role=${alt ? 'img' : undefined} aria-label=${alt || undefined} aria-hidden=${alt ? undefined : 'true'}>
        <rect class="empty" width=${width} height=${height} />
        ${src && broken !== src && html`<image key=${number === null ? src : 'live'} href=${src} width=${width} height=${height} onError=${() => setBroken(src)} />`}
        ${corners.map(([id, u, v]) => html`<circle key=${id} class="corner" cx=${u} cy=${v} r=${r} />`)}
        ${times > 0 && corners.map(([id, u, v, du = 0, dv = 0]) => html`<path key=${`a${id}`} class="arrow" d=${arrow(u, v, du * times, dv * times, r)} />`)}
        ${belongs && html`<polygon class="belongs" points=${belongs.map((at) => at.join(',')).join(' ')} stroke-width=${width / 240} stroke-dasharray="${width / 80} ${width / 130}" />`}
      </svg>
    </div>
    ${corners.length > 0 && html`<figcaption class="small quiet legend">
      <span>○ ${t('picture.corner')}</span>
      ${times > 0 && html`<span>→ ${t('picture.arrow', { times: Math.round(times), px: significant(longest, 2) })}</span>`}
    </figcaption>`}
  </figure>`;
}

function arrow(u, v, du, dv, r) {
  const length = Math.hypot(du, dv);
  if (length < r) return `M${u} ${v}l${du} ${dv}`;
  const [x, y, head] = [du / length, dv / length, r * 1.4];
  const [tipU, tipV] = [u + du, v + dv];
  return `M${u} ${v}L${tipU} ${tipV}M${tipU - head * (x + y * 0.6)} ${tipV - head * (y - x * 0.6)}L${tipU} ${tipV}L${tipU - head * (x - y * 0.6)} ${tipV - head * (y + x * 0.6)}`;
}
