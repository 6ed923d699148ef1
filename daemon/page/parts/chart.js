// Charts as SVG, in one place: lines over a number of views, bars, and a control chart.
import { html } from '../vendor/preact.js';
import { mm, significant } from '../state/numbers.js';
import { t } from '../state/words.js';
import { logTicks, ticks } from './ticks.js';

const W = 640;
const H = 200;
const LEFT = 66;
const BOTTOM = 50;
const RIGHT = 14;
const TOP = 26; // room for letters that are larger where the chart is narrow

const between = (low, high, a, b) => (value) => a + ((value - low) / (high - low || 1)) * (b - a);

function Axes({ x, y, yTicks, xTicks, xLabel, yLabel }) {
  return html`<g class="axes">
    ${yTicks.map((tick) => html`<path class="grid-line" d="M${LEFT} ${y(tick)}H${W - RIGHT}" /><text x=${LEFT - 8} y=${y(tick) + 4} text-anchor="end">${significant(tick, tick === 0 ? 1 : 2)}</text>`)}
    ${xTicks.map((tick) => html`<text x=${x(tick)} y=${H - BOTTOM + 20} text-anchor="middle">${tick}</text>`)}
    <text x=${W - RIGHT} y=${H - 3} text-anchor="end">${xLabel}</text>
    <text x=${LEFT + 4} y=${TOP - 6}>${yLabel}</text>
  </g>`;
}

const line = (points) => points.map(([x, y], index) => `${index ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`).join('');

/** U (k = 2): what the views tell (solid), what the next will (dashed), what was asked (line). `history`: [{ station, now_mm, planned_mm }]. */
export function UncertaintyCurve({ history, goal_mm, stations }) {
  const known = history.filter(({ now_mm }) => now_mm !== null && now_mm !== undefined);
  const planned = history.filter(({ planned_mm }) => planned_mm !== null && planned_mm !== undefined);
  const all = [...known.map((row) => row.now_mm), ...planned.map((row) => row.planned_mm)];
  if (goal_mm) all.push(goal_mm);
  if (!all.length) return html`<p class="quiet chart-empty">${t('curve.none')}</p>`;
  const [low, high] = [Math.min(...all) / 1.4, Math.max(...all) * 1.4];
  const last = Math.max(stations, ...history.map(({ station }) => station), 1);
  const x = between(0, last, LEFT + 10, W - RIGHT - 10);
  const logged = between(Math.log(low), Math.log(high), H - BOTTOM, TOP);
  const y = (value) => logged(Math.log(value));
  const solid = known.map(({ station, now_mm }) => [x(station), y(now_mm)]);
  const ahead = planned.at(-1);
  const dashed = ahead && [...(solid.length ? [solid.at(-1)] : []), [x(Math.min(last, ahead.station + 1)), y(ahead.planned_mm)]];
  const newest = known.at(-1);
  return html`<figure class="chart">
    <svg viewBox="0 0 ${W} ${H}" role="img" aria-label=${t('curve.alt', { now: mm(newest?.now_mm), count: known.length })}>
      <${Axes} x=${x} y=${y} yTicks=${logTicks(low, high)} xTicks=${ticks(0, last, 8, true)} xLabel=${t('curve.views')} yLabel="mm" />
      ${goal_mm && html`<path class="goal" d="M${LEFT} ${y(goal_mm)}H${W - RIGHT}" />`}
      ${dashed && html`<path class="dashed" d=${line(dashed)} /><circle class="open" cx=${dashed.at(-1)[0]} cy=${dashed.at(-1)[1]} r="5" />`}
      ${solid.length > 1 && html`<path class="solid" d=${line(solid)} />`}
      ${solid.map(([cx, cy]) => html`<circle class="dot" cx=${cx} cy=${cy} r="5" />`)}
    </svg>
    <figcaption class="small quiet legend">
      <span><b class="key-solid" aria-hidden="true"></b>${t('curve.told')}</span>
      <span><b class="key-dashed" aria-hidden="true"></b>${t('curve.next')}</span>
      ${goal_mm && html`<span><b class="key-goal" aria-hidden="true"></b>${t('curve.asked')} ${mm(goal_mm)}</span>`}
    </figcaption>
  </figure>`;
}

/** The drift's control chart: the average's way from zero, its limit, the learning phase shaded. `points` as GET /drift. */
export function ControlChart({ points, learn, limit_mm }) {
  if (!points.length) return html`<p class="quiet chart-empty">${t('drift.none')}</p>`;
  const high = Math.max(...points.map(({ drift_mm }) => drift_mm), limit_mm ?? 0, ...points.map((p) => p.limit_mm ?? 0)) * 1.25 || 1;
  const last = Math.max(points.length, learn + 1);
  const x = between(1, last, LEFT + 14, W - RIGHT - 14);
  const y = between(0, high, H - BOTTOM, TOP);
  const limits = points.flatMap((point, index) => (point.limit_mm === null ? [] : [[x(index + 1), y(point.limit_mm)]]));
  const learned = points.findLastIndex(({ standing }) => standing === 'learning') + 1;
  return html`<figure class="chart">
    <svg viewBox="0 0 ${W} ${H}" role="img" aria-label=${t('drift.alt', { count: points.length, drift: mm(points.at(-1).drift_mm), limit: mm(limit_mm) })}>
      ${learned > 0 && html`<rect class="learning" x=${LEFT} y=${TOP} width=${Math.max(12, x(learned) + 10 - LEFT)} height=${H - BOTTOM - TOP} />
        <text class="in" x=${LEFT + 8} y=${TOP + 22}>${t('drift.learning')}</text>`}
      <${Axes} x=${x} y=${y} yTicks=${ticks(0, high, 5)} xTicks=${ticks(1, last, 8, true)} xLabel=${t('drift.verifications')} yLabel="mm" />
      ${limits.length > 0 && html`<path class="limit" d=${line([...limits, [W - RIGHT, limits.at(-1)[1]]])} />`}
      <path class="solid" d=${line(points.map(({ drift_mm }, index) => [x(index + 1), y(drift_mm)]))} />
      ${points.map(({ drift_mm, standing }, index) =>
        standing === 'drifting' || standing === 'out-of-tolerance'
          ? html`<path class="alarm-dot" d="M${x(index + 1) - 6} ${y(drift_mm) + 5}h12l-6 -12Z" />`
          : html`<circle class="dot" cx=${x(index + 1)} cy=${y(drift_mm)} r="5" />`)}
    </svg>
    <figcaption class="small quiet legend">
      <span><b class="key-solid" aria-hidden="true"></b>${t('drift.average')}</span>
      ${limits.length > 0 && html`<span><b class="key-limit" aria-hidden="true"></b>${t('drift.limit')} ${mm(limit_mm)}</span>`}
      <span>▲ ${t('drift.alarm')}</span>
    </figcaption>
  </figure>`;
}

/** Points (value, U) from left to right with whiskers of U, each on its own; `tolerance_mm`: a line, null for none. */
function Whiskers({ rows, tolerance_mm, alt, xLabel, legend }) {
  const high = Math.max(...rows.map(({ value, U }) => value + U), tolerance_mm ?? 0) * 1.15 || 1;
  const x = between(0.5, rows.length + 0.5, LEFT + 14, W - RIGHT - 14);
  const y = between(0, high, H - BOTTOM, TOP);
  const every = Math.ceil(rows.length / 12);
  return html`<figure class="chart">
    <svg viewBox="0 0 ${W} ${H}" role="img" aria-label=${alt}>
      <${Axes} x=${x} y=${y} yTicks=${ticks(0, high, 5)} xTicks=${[]} xLabel=${xLabel} yLabel="mm" />
      ${rows.map(({ name }, index) => index % every === 0 && html`<text x=${x(index + 1)} y=${H - BOTTOM + 20} text-anchor="middle">${name}</text>`)}
      ${tolerance_mm && html`<path class="limit" d="M${LEFT} ${y(tolerance_mm)}H${W - RIGHT}" />`}
      ${rows.map(({ value, U, wrong }, index) => html`<path class="whisker" d="M${x(index + 1)} ${y(Math.max(0, value - U))}V${y(value + U)}M${x(index + 1) - 5} ${y(value + U)}h10M${x(index + 1) - 5} ${y(Math.max(0, value - U))}h10" />
        ${wrong
          ? html`<path class="alarm-dot" d="M${x(index + 1) - 6} ${y(value) + 5}h12l-6 -12Z" />`
          : html`<circle class="dot" cx=${x(index + 1)} cy=${y(value)} r="5" />`}`)}
    </svg>
    <figcaption class="small quiet legend">${legend}
      ${tolerance_mm && html`<span><b class="key-limit" aria-hidden="true"></b>${t('touch.limit')} ${mm(tolerance_mm)}</span>`}</figcaption>
  </figure>`;
}

/** The misses of one touch test, each with U (k = 2). `points`: as in its result. */
export function MissChart({ points, tolerance_mm }) {
  const rows = points.map(({ name, length_mm, expanded_mm, outlying }) => ({ name: name.replace(/^point /, ''), value: length_mm, U: expanded_mm, wrong: outlying }));
  const worst = Math.max(...rows.map(({ value }) => value));
  return html`<${Whiskers} rows=${rows} tolerance_mm=${tolerance_mm} alt=${t('touch.chart-alt', { count: rows.length, largest: mm(worst) })} xLabel=${t('verify.point')}
    legend=${html`<span>● ${t('touch.length-U')}</span><span>▲ ${t('touch.outlying')}</span>`} />`;
}

/** The largest miss of each touch test since the calibration is active. `tests`: of GET /drift, the oldest first. */
export function TouchChart({ tests }) {
  const rows = tests.map(({ largest_mm, expanded_mm, accepted }, index) => ({ name: index + 1, value: largest_mm, U: expanded_mm, wrong: !accepted }));
  return html`<${Whiskers} rows=${rows} alt=${t('touch.chart-alt', { count: rows.length, largest: mm(rows.at(-1).value) })} xLabel=${t('touch.tests')}
    legend=${html`<span>● ${t('touch.largest-U')}</span><span>▲ ${t('touch.not-accepted')}</span>`} />`;
}

/** A bar of `value` beside its number; `end` is the longest. */
export const Bar = ({ value, end, text }) =>
  html`<span class="bar-cell"><span>${text}</span><svg class="bar" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true"><rect width=${value ? Math.max(1, (100 * value) / (end || 1)) : 0} height="10" /></svg></span>`;
