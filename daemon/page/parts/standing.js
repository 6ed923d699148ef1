// Which sentence of the cell holds (pure).

/** `runs`: the newest first. Where one of the target was aborted or failed, the arm may stand anywhere; null otherwise. */
export function endedEarly(runs = []) {
  const last = runs.find(({ kind }) => kind !== 'jog');
  return last && last.kind !== 'scan' && ['aborted', 'failed'].includes(last.state) ? last : null;
}

/** The first thing in the way of working decides. `seen`: the last look at the target, null before the first; it matters after `ended` alone. */
export function standingOf({ running, ready, none, drift, ended, seen }) {
  if (running) return 'running';
  if (!ready?.ready) return 'not-ready';
  if (ended && !seen) return 'looking';
  if (ended && !seen.corners?.length) return none ? 'none-away' : 'away';
  if (none) return 'none';
  if (['drifting', 'out-of-tolerance'].includes(drift?.standing)) return 'moved';
  return drift?.standing === 'steady' ? 'good' : 'unchecked';
}

/** Where a run took its last picture with the target in it; where it began, while its pictures were not looked at; null without any. */
export function lastSeenAt(views = []) {
  const seen = views.filter(({ corners }) => corners.length > 0).at(-1) ?? views.find(({ status }) => status === 'taken');
  return seen?.base_T_flange ?? null;
}
