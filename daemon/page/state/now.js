// What the page knows at this moment. Screens read these signals; `live.js` and `session.js` write them.
import { computed, signal } from '../vendor/preact.js';

export const session = signal(null); // { name, role, asked, cell, software, languages, last_event_id }
export const robot = signal(null);
export const run = signal(null); // the run in progress, or the last one heard of
export const ready = signal(null); // of the first camera
export const readyOf = signal({}); // of each further camera, by its name
export const devices = signal([]);
export const holder = signal(null);
export const look = signal(null);
export const changed = signal({}); // a number a kind of event: screens that show such things ask anew
export const refused = signal(null); // why the stream is refused

export const heardAt = signal(null); // on this tab's steady clock, ms
export const linked = signal(0); // how often the stream was heard anew
export const clock = signal(performance.now());

export const OLD_S = 3;
export const LOST_S = 5;

export const age_s = computed(() => (heardAt.value === null ? null : Math.max(0, clock.value - heardAt.value) / 1000));
export const old = computed(() => age_s.value === null || age_s.value > OLD_S);
const opened = performance.now();
export const lost = computed(() => (age_s.value ?? (clock.value - opened) / 1000) > LOST_S);
export const running = computed(() => run.value !== null && !run.value.over);

const RANK = { nobody: 0, viewer: 1, operator: 2, admin: 3 };
export const may = (role) => (RANK[session.value?.role] ?? 0) >= RANK[role];

export const progress = signal({}); // of each kind of event that says how far something is: the data of the last one

export function note(kind, data) {
  if (data?.progress !== undefined) progress.value = { ...progress.value, [kind]: data };
  changed.value = { ...changed.value, [kind]: (changed.value[kind] ?? 0) + 1 };
}
