"""KinHEC's tracks: pose pairs with known X, its reference solvers beside ours, under its own protocol.

`python -m benchmarks.kinhec [--quick] [--data DIR]`; needs `pip install kinhec`. Its smoke tier is generated unless a
folder is given. Ours gets the very keyframes the reference solvers get; the clock offset is the true one ("oracle").
"""

import argparse
import contextlib
import importlib.util
import io
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from calibration.errors import UndeterminedError
from calibration.pose_level import solve_hand_eye_poses
from calibration.transforms import inverse

OURS = "handeyed"
MM = np.array([[1, 1, 1, 1e3]] * 3 + [[1, 1, 1, 1]])


def main() -> None:
    """One line a track: our median errors, the best reference solver's of each, and how many were refused."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="at most four sequences a track")
    parser.add_argument("--data", type=Path, help="a generated KinHEC data set")
    options = parser.parse_args()
    if importlib.util.find_spec("kinhec") is None:
        print("kinhec is not installed: pip install kinhec")
        return
    if options.data:
        table(options.data, options.quick)
        return
    with tempfile.TemporaryDirectory() as folder:
        from kinhec.cli import main as kinhec

        with contextlib.redirect_stdout(io.StringIO()):
            kinhec(["generate", "--tier", "smoke", "--out", folder])
        table(Path(folder), options.quick)


def table(data: Path, quick: bool) -> None:
    """Every track of a data set. Medians are over the sequences that ours answers, for every solver alike."""
    import kinhec.benchmark as reference
    from kinhec.io import load_manifest, load_sequence

    manifest = load_manifest(data)
    print(f"{'track':>12} {'answered':>8} {'deg':>8} {'best':>8} {'by':<20} {'mm':>9} {'best':>9} by")
    for track, rows in manifest.groupby("track", sort=False):
        errors = defaultdict(list)
        refused: dict[str, int] = defaultdict(int)
        for name in rows["sequence_id"][: 4 if quick else None]:
            sequence = load_sequence(data, name, manifest)
            try:
                errors[OURS].append(_ours(reference, sequence))
            except UndeterminedError as undetermined:
                refused[undetermined.code] += 1
                continue
            for row in reference.evaluate_sequence(sequence, list(reference.SOLVERS)):
                pair = (row["X_rot_err_deg"], row["X_trans_err_mm"]) if row["ok"] else (np.inf, np.inf)
                errors[row["solver"]].append(pair)
        _print(str(track), dict(errors), dict(refused))


def _ours(reference, sequence):  # type: ignore[no-untyped-def]
    from kinhec.metrics import calibration_errors

    data = reference._keyframe_data(sequence, None if sequence.synchronous else sequence.time_offset)
    if data is None:
        raise UndeterminedError("too-few-poses", "too few frames", "record more")
    base_T_flange, seen = MM * data[0], MM * data[1]
    if sequence.eye_in_hand:
        X = solve_hand_eye_poses("eye-in-hand", base_T_flange, inverse(seen)).mount_T_camera
    else:  # KinHEC's X is the marker's pose in the flange there
        X = solve_hand_eye_poses("eye-to-hand", base_T_flange, seen).anchor_T_target
    found = calibration_errors(X / MM, sequence.X)
    return found["X_rot_err_deg"], found["X_trans_err_mm"]


def _print(track: str, errors: dict[str, list[tuple[float, float]]], refused: dict[str, int]) -> None:
    count = len(errors.get(OURS, ()))
    line = f"{track:>12} {count:>4}/{count + sum(refused.values()):<3}"
    if count:
        medians = {name: np.median(np.array(pairs), axis=0) for name, pairs in errors.items()}
        ours = medians.pop(OURS)
        best = [min(medians, key=lambda name, axis=axis: medians[name][axis]) for axis in (0, 1)]  # type: ignore[misc]
        line += f" {ours[0]:8.4f} {medians[best[0]][0]:8.4f} {best[0]:<20}"
        line += f" {ours[1]:9.3f} {medians[best[1]][1]:9.3f} {best[1]}"
    print(line + (f"  refused: {refused}" if refused else ""), flush=True)


if __name__ == "__main__":
    main()
