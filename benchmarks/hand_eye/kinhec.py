"""KinHEC's tracks: pose pairs with known X, its reference solvers and ours, under its own protocol.

`python -m benchmarks.hand_eye.kinhec [--tier smoke|small|medium] [--keep DIR] [--tracks NAME ...] [--solvers NAME
...]`; needs `pip install kinhec`. All solvers get the same keyframes; the clock offset is the true one ("oracle").
Camera poses relative to the first one (KinHEC's `vo_origin`, monocular odometry) have no known scale, which ours is set
to estimate. KinHEC scores a track by the medians of X's rotation and translation error; here over the sequences that
ours answers, for every solver alike. Results of the others where ours refuses are listed below.
"""

import argparse
import contextlib
import importlib.util
import io
import pickle
import tempfile
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.errors import UndeterminedError
from calibration.transforms import inverse
from tests.support.pose_arrays import solve_hand_eye_poses

MM = np.array([[1, 1, 1, 1e3]] * 3 + [[1, 1, 1, 1]])
Errors = tuple[float, float]
"""Errors of X: degrees, millimetres; infinite where a solver fails."""

NOT_GIVEN: Errors = (np.inf, np.inf)


@dataclass(frozen=True)
class Scored:
    """One sequence: our errors or the reason of refusal, and the reference solvers' errors by name."""

    track: str
    ours: Errors | str
    references: dict[str, Errors]


def main() -> None:
    """One line per track and error: ours, the best reference solver's, and whether it was reached."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tier", default="smoke", help="smoke (46 sequences), small (562) or medium (about 10,000)")
    parser.add_argument("--keep", type=Path, help="folder that keeps the sequences and the reference solvers' errors")
    parser.add_argument("--tracks", nargs="+", help="only these tracks")
    parser.add_argument("--solvers", nargs="+", help="only these reference solvers; the slow ones refine (+lm) or draw")
    parser.add_argument("--chance", action="store_true", help="say how much of each ratio chance may be")
    options = parser.parse_args()
    if importlib.util.find_spec("kinhec") is None:
        print("kinhec is not installed: pip install kinhec")
        return
    if options.keep:
        scored = scores(options.keep, options.tier, options.tracks, options.solvers)
    else:
        with tempfile.TemporaryDirectory() as folder:
            scored = scores(Path(folder), options.tier, options.tracks, options.solvers)
    print(f"KinHEC, tier {options.tier}: median error of X over the sequences that ours answers")
    print(f"{'track':>12} {'answered':>8} {'':>4} {'ours':>9} {'best reference':>14} {'ratio':>6}")
    for track in dict.fromkeys(one.track for one in scored):
        _print(track, [one for one in scored if one.track == track], options.chance)


def scores(folder: Path, tier: str, tracks: Sequence[str] | None, solvers: Sequence[str] | None) -> list[Scored]:
    """Every sequence of a tier, or of some tracks, generated into the folder unless it exists."""
    import kinhec.benchmark as reference
    from kinhec.cli import main as kinhec
    from kinhec.io import load_manifest, load_sequence

    asked = ["--tier", tier, "--out", str(folder), "--work-dir", str(folder / "work"), "--no-card"]
    with contextlib.redirect_stdout(io.StringIO()):
        kinhec(["generate", *asked, *(["--tracks", *tracks] if tracks else [])])
    file = folder / "references.pickle"
    known: dict[str, dict[str, Errors]] = pickle.loads(file.read_bytes()) if file.exists() else {}
    manifest = load_manifest(folder)
    names, scored = list(solvers or reference.SOLVERS), []
    if unknown := set(names) - set(reference.SOLVERS):
        raise SystemExit(f"no reference solvers of KinHEC: {sorted(unknown)}; it has {sorted(reference.SOLVERS)}")
    for row in manifest.to_dict("records"):
        if tracks and row["track"] not in tracks:
            continue
        sequence = load_sequence(folder, row["sequence_id"], manifest)
        errors = known.setdefault(sequence.id, {})
        if missing := [name for name in names if name not in errors]:
            errors.update(_references(reference, sequence, missing))
            file.write_bytes(pickle.dumps(known))
        scored.append(Scored(row["track"], _ours(reference, sequence), {name: errors[name] for name in names}))
    return scored


def _references(reference, sequence, names: list[str]) -> dict[str, Errors]:  # type: ignore[no-untyped-def]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rows = reference.evaluate_sequence(sequence, names)
    return {row["solver"]: (row["X_rot_err_deg"], row["X_trans_err_mm"]) if row["ok"] else NOT_GIVEN for row in rows}


def _ours(reference, sequence) -> Errors | str:  # type: ignore[no-untyped-def]
    from kinhec.metrics import calibration_errors

    data = reference._keyframe_data(sequence, None if sequence.synchronous else sequence.time_offset)
    if data is None:
        return "too-few-poses"
    base_T_flange, seen = MM * data[0], MM * data[1]
    metric = sequence.manifest["world_frame"] != "vo_origin"
    try:
        if sequence.eye_in_hand:
            solution = solve_hand_eye_poses("eye-in-hand", base_T_flange, inverse(seen), metric=metric)
            X = solution.mount_T_camera
        else:  # there KinHEC's X is the marker's pose in the flange
            X = solve_hand_eye_poses("eye-to-hand", base_T_flange, seen, metric=metric).anchor_T_target
    except UndeterminedError as undetermined:
        return undetermined.code
    found = calibration_errors(X / MM, sequence.X)
    return found["X_rot_err_deg"], found["X_trans_err_mm"]


def _print(track: str, scored: list[Scored], chance: bool) -> None:
    answered = [one for one in scored if not isinstance(one.ours, str)]
    refused = [one for one in scored if isinstance(one.ours, str)]
    if answered:
        ours = np.median([one.ours for one in answered], axis=0)
        medians = _medians(answered)
        for axis, unit in enumerate(("deg", "mm")):
            best = min(medians, key=lambda name, axis=axis: medians[name][axis])  # type: ignore[misc]
            value = medians[best][axis]
            met = "met" if ours[axis] <= value else "NOT met"
            head = f"{track:>12} {len(answered):>4}/{len(scored):<3}" if axis == 0 else " " * 21
            print(f"{head} {unit:>4} {ours[axis]:9.4f} {value:14.4f} {ours[axis] / value:6.2f} {met:>7}  {best}")
            if chance:
                print(f"{'':>26}{_by_chance([(one.ours[axis], one.references[best][axis]) for one in answered])}")  # type: ignore[misc]
    if refused:
        reasons = ", ".join(f"{code} {count}" for code, count in Counter(str(one.ours) for one in refused).items())
        medians = _medians(refused)
        best_mm = min(pair[1] for pair in medians.values())
        print(f"{track:>12} refused: {reasons}; the best median among the reference solvers there: {best_mm:.3g} mm")


def _by_chance(pairs: list[tuple[float, float]]) -> str:
    """Confidence interval of the ratio of the medians (bootstrap over sequences)."""
    errors = np.array(pairs)
    drawn = errors[np.random.default_rng(0).integers(0, len(errors), (2000, len(errors)))]
    ours, theirs = np.moveaxis(np.median(drawn, axis=1), -1, 0)
    low, high = np.quantile(ours / theirs, [0.025, 0.975])
    nearer, mean = int(np.sum(errors[:, 0] < errors[:, 1])), float(np.exp(np.mean(np.log(errors[:, 0] / errors[:, 1]))))
    return (
        f"95 % of such tiers: {low:.2f} to {high:.2f}; nearer in {nearer} of {len(errors)},"
        f" geometric mean of the ratios {mean:.2f}"
    )


def _medians(scored: list[Scored]) -> dict[str, Errors]:
    names = scored[0].references
    return {name: tuple(np.median([one.references[name] for one in scored], axis=0)) for name in names}  # type: ignore[misc]


if __name__ == "__main__":
    main()
