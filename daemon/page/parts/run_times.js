// How far a run is: which picture comes, how long it took so far, and how long it will take (pure).

/** Seconds a run took so far and has left, `since_s` after its last change; `left_s` null where that is not known. */
export function timesOf({ created_at, updated_at, stations, planning }, since_s) {
  const now_s = Date.parse(updated_at) / 1000 + since_s;
  const elapsed_s = now_s - Date.parse(created_at) / 1000;
  const history = planning?.history ?? [];
  const [first, newest] = [history[0], history.at(-1)];
  if (!stations || !newest || newest.station === first.station) return { elapsed_s, left_s: null };
  const [first_s, newest_s] = [Date.parse(first.at) / 1000, Date.parse(newest.at) / 1000];
  const each_s = (newest_s - first_s) / (newest.station - first.station);
  return { elapsed_s, left_s: Math.max(0, each_s * Math.max(0, stations - newest.station) - (now_s - newest_s)) };
}

/** How many pictures a run has `taken`, `of` how many, and the number of the one at which it is, from 1. A first look and a picture that was refused are pictures, but no stations. */
export function picturesOf({ station, stations, state, planning, request, links }) {
  const stored = planning ? Object.keys(links).filter((name) => name.startsWith('frame ')).length : station;
  const taken = stored - (request?.manual && state === 'planning' ? 1 : 0); // the newest is no station yet
  const of = stations + taken - station;
  return { taken, of, number: Math.min(taken + 1, of) };
}
