"""The arm's own errors: a registered point before and after they are identified, on simulated arms as built.

`python -m benchmarks.arm [--arms N] [--seed FIRST] [--only TABLE] [--size ARM]`. Held-out poses are anywhere
in a box of a third by 0.7 by 0.4 of the reach; the registered point is 450 to 650 mm before the camera. Arms, pixels
(0.05 px) and scatter (0.02 mm, 0.002 degrees per axis) as in `tests/simulated/arms.py`.
"""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks.registration.door_as_built import door_as_built_table
from calibration.errors import CalibrationError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.solve import estimate_session
from calibration.solver.registered_points import registered_points
from calibration.transforms import map_points
from extensions.arm_identification.mathematics.identification import identify_arm_session
from extensions.arm_identification.mathematics.views import ArmExperiment, PointsOfInterest
from mock_robot.arm.built_arm import ArmClass, BuiltArm, build_arm
from tests.extensions.arm_identification.more_views import predict_and_reach
from tests.simulated.arms import (
    MOUNT_T_CAMERA,
    REPEATABILITY,
    ArmCell,
    arm_cell,
    box_postures,
    draw_points,
    normalised_rms,
    reachable_views,
    rms_length,
    target_places,
)
from tests.simulated.changed_cells import Change, changes_of
from tests.simulated.other_arms import FAMILIES, build_other_arm
from tests.simulated.sessions import BOARD, CAMERA

SIZES = ("IRB 120-3/0.6", "IRB 2600-20/1.65", "IRB 6700-200/2.60")
OTHER_SIZES = ("IRB 1600-6/1.45", *SIZES[1:])
PLACES, CANDIDATES, HELD_OUT = 4, 50, 50
JOGGED = ((), (10, 10, 10, 10), (20,), (12,), (6,))
"""Views of each place as they are jogged in one posture, and, without any, 40 that are planned."""
MORE_COUNTS = (0, 10, 20, 30)


@dataclass(frozen=True)
class Row:
    """One arm: RMS of a registered point, mm, before, after and at the bound; RMS of normalised errors.

    `high_mm`: by how much points are too high in the mean; `claim_mm`: one standard deviation of them as claimed.
    """

    taken_up: bool
    before_mm: float
    after_mm: float
    bound_mm: float
    normalised: float
    seen_before_mm: float = 0.0
    seen_after_mm: float = 0.0
    seen_normalised: float = 1.0
    high_mm: float = 0.0
    claim_mm: float = 0.0


def main() -> None:
    """Every table of the arm's errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=20, help="simulated arms a row")
    parser.add_argument("--seed", type=int, default=0, help="of the first arm")
    parser.add_argument("--only", choices=tuple(TABLES), help="one of the tables")
    parser.add_argument(
        "--size", choices=(*SIZES, OTHER_SIZES[0]), action="append", help="only this arm, may be repeated"
    )
    options = parser.parse_args()
    sizes = options.size or SIZES
    for name, table in TABLES.items():
        if options.only in (None, name):
            of_table = OTHER_SIZES if name in ("others", "families") and not options.size else sizes
            table(range(options.seed, options.seed + options.arms), of_table)


def planned_table(seeds: range, sizes: Sequence[str]) -> None:
    """40 planned views of a target at four unknown places."""
    print(
        f"Standard arms, 40 planned views of {PLACES} unknown places ({len(seeds)} arms a row): RMS in mm over the box"
    )
    print(f"{'arm':20} {'taken up':>8} {'before':>7} {'after':>7} {'times':>6} {'bound':>7} {'/bound':>6} {'z':>5}")
    for name in sizes:
        rows = [_planned(find_arm(name), seed) for seed in seeds]
        before, after, bound = (
            _rms([getattr(row, part) for row in rows]) for part in ("before_mm", "after_mm", "bound_mm")
        )
        taken, z = sum(row.taken_up for row in rows), _rms([row.normalised for row in rows])
        print(
            f"{name:20} {taken:>5}/{len(seeds):<2} {before:7.3f} {after:7.3f} {before / after:6.1f} {bound:7.3f}"
            f" {after / bound:6.2f} {z:5.2f}",
            flush=True,
        )


def ordinary_table(seeds: range, sizes: Sequence[str]) -> None:
    """12 views of an ordinary hand-eye session."""
    print(f"Standard arms, 12 ordinary views of one place ({len(seeds)} arms a row): RMS in mm there, and over the box")
    print(
        f"{'arm':20} {'taken up':>8} {'not worse':>9} {'median times':>12} {'z seen':>6} {'z box':>6} {'box times':>9}"
    )
    for name in sizes:
        rows = [_ordinary(find_arm(name), "standard", seed) for seed in seeds]
        times = np.array([row.seen_before_mm / row.seen_after_mm for row in rows])
        in_box = np.array([row.before_mm / row.after_mm for row in rows])
        z_seen, z_box = _rms([row.seen_normalised for row in rows]), _rms([row.normalised for row in rows])
        taken = sum(row.taken_up for row in rows)
        print(f"{name:20} {taken:>5}/{len(seeds):<2} {np.mean(times >= 1):9.0%} {np.median(times):12.2f}", end=" ")
        print(f"{z_seen:6.2f} {z_box:6.2f} {np.median(in_box):9.2f}", flush=True)


def others_table(seeds: range, sizes: Sequence[str]) -> None:
    """Planned views, and sessions in one posture as they are jogged, with arms of the model and of other forms."""
    _print_others({name: [(name, seed) for seed in seeds] for name in sizes}, JOGGED)


def families_table(seeds: range, sizes: Sequence[str]) -> None:
    """The same with the sizes in turn, one a seed, of planned views and of 20 in one posture."""
    _print_others({"in turn": [(sizes[seed % len(sizes)], seed) for seed in seeds]}, ((), (20,)))


def _print_others(arms: Mapping[str, Sequence[tuple[str, int]]], sessions: Sequence[tuple[int, ...]]) -> None:
    """`arms`: size and seed of those of each row."""
    count = len(next(iter(arms.values())))
    print(f"Planned, or jogged in one posture ({count} arms a row): RMS in mm over the box; z: errors over the claim")
    print(
        f"{'arm':20} {'errors':10} {'views':>11} {'taken up':>8} {'refused':>7} {'before':>7} {'after':>7} {'times':>6}"
        f" {'worse':>6} {'by > U':>6} {'claim':>6} {'z':>5} {'too high mm':>11}"
    )
    for name, family, views in product(arms, ("standard", *FAMILIES), sessions):
        every = [_other(find_arm(size), family, seed, views) for size, seed in arms[name]]
        rows = [row for row in every if row is not None]
        before, after, claim, z = (
            _rms([getattr(row, part) for row in rows]) if rows else np.nan
            for part in ("before_mm", "after_mm", "claim_mm", "normalised")
        )
        high_mm = np.mean([row.high_mm for row in rows])
        taken = sum(row.taken_up for row in rows)
        of_row = f"{name:20} {family:10} {'+'.join(map(str, views)) or '40 planned':>11}"
        by_mm = [row.taken_up * (row.after_mm - row.before_mm) for row in rows]
        worse = np.mean([one > 0 for one in by_mm])
        beyond = sum(one > 2 * row.claim_mm for one, row in zip(by_mm, rows, strict=True))
        print(
            f"{of_row} {taken:>5}/{count:<2} {len(every) - len(rows):7} {before:7.3f} {after:7.3f}"
            f" {before / after:6.1f} {worse:6.0%} {beyond:6} {claim:6.3f} {z:5.2f} {high_mm:11.2f}",
            flush=True,
        )


def perfect_table(seeds: range, sizes: Sequence[str]) -> None:
    """Arms that are as drawn."""
    print(f"Perfect arms, 12 ordinary views ({5 * len(seeds)} arms a row)")
    print(f"{'arm':20} {'not taken up':>12} {'point error / without':>22}")
    for name in sizes:
        rows = [_ordinary(find_arm(name), "perfect", seed) for seed in range(seeds.start, seeds.start + 5 * len(seeds))]
        left = np.mean([not row.taken_up for row in rows])
        ratio = _rms([row.before_mm for row in rows])
        print(f"{name:20} {left:12.1%} {_rms([row.after_mm for row in rows]) / ratio:22.3f}", flush=True)


def speed_table(_: range, sizes: Sequence[str]) -> None:
    """Time of the identification with 200 views, without and with what a solve takes anyway."""
    arm, rng = find_arm(sizes[len(sizes) // 2]), np.random.default_rng(0)
    target = target_places(rng, arm, 1)
    cell = arm_cell(rng, build_arm(arm, "standard", 0), [reachable_views(rng, arm, target[0], 200)], target)
    start = time.perf_counter()
    estimate_session(cell.problems[0])
    solved = time.perf_counter() - start
    start = time.perf_counter()
    identify_arm_session(arm, cell.problems)
    whole = time.perf_counter() - start
    print(
        f"200 views, {len(ArmErrorModel(arm))} parameters: {whole - solved:.2f} s besides {solved:.2f} s of the solve"
    )


def joint_table(seeds: range, sizes: Sequence[str]) -> None:
    """One axis's zero moved by 0.02 degrees between two verifications of five stations."""
    print(f"Zero of one axis moved by 0.02 deg, camera or target by 0.3 mm, nothing ({len(seeds)} arms a row): named")
    changes = [Change(axis=axis, zero_rad=float(np.radians(0.02))) for axis in range(1, 7)]
    changes += [Change(camera_mm=0.3), Change(target_mm=0.3), Change()]
    print(f"{'arm':20}" + "".join(f"{change!s:>9}" for change in changes))
    for name in sizes:
        right = []
        for change in changes:
            found = [changes_of(find_arm(name), change, seed)[0] for seed in seeds]
            names = [f"axis-{one.axis}" if one.axis else one.cause.removesuffix("-moved") for one in found]
            right.append(np.mean([named == str(change) for named in names]))
        print(f"{name:20}" + "".join(f"{share:9.0%}" for share in right), flush=True)


def more_table(seeds: range, sizes: Sequence[str]) -> None:
    """What more views were predicted to bring, and what they brought."""
    print(f"Standard arms, registered points after more views ({len(seeds)} arms a row): RMS in mm, predicted/reached")
    print(f"{'arm':20} {'places':>6} {'arms':>5}" + "".join(f"{f'+{count}':>14}" for count in MORE_COUNTS))
    for name, places in ((name, places) for name in sizes for places in (1, 3)):
        every = [predict_and_reach(find_arm(name), places, seed, MORE_COUNTS) for seed in seeds]
        rows = [row for row in every if row is not None]
        print(f"{name:20} {places:6} {len(rows):5}", end="")
        for at in range(len(MORE_COUNTS)):
            predicted, reached = (
                _rms([row.predicted_mm[at] for row in rows]),
                _rms([row.reached_mm[at] for row in rows]),
            )
            print(f"{f'{predicted:.3f}/{reached:.3f}':>14}", end="")
        print(flush=True)


def _planned(arm: Arm, seed: int, family: str = "standard") -> Row:
    rng = np.random.default_rng([seed, 1])
    model, targets = ArmErrorModel(arm), target_places(rng, arm, PLACES)
    interest = _interest(rng, arm)
    candidates = [Postures(reachable_views(rng, arm, target, CANDIDATES)) for target in targets]
    noise = ExpectedNoise(REPEATABILITY.image_px, REPEATABILITY.robot_rotation_rad, REPEATABILITY.robot_translation_mm)
    scenes = [Scene("eye-in-hand", BOARD, CAMERA, MOUNT_T_CAMERA, target, noise) for target in targets]
    experiment = ArmExperiment(model, scenes, candidates, interest, model.sigmas)
    views, _ = experiment.choose(40)
    joints = [candidates[place].joints_rad[[row for at, row in views if at == place]] for place in range(PLACES)]
    cell = arm_cell(rng, built_of_family(arm, family, seed), joints, targets)
    elsewhere = _interest(rng, arm)
    bound = ArmExperiment(model, scenes, candidates, elsewhere, model.sigmas)
    return _measure(cell, elsewhere, bound.point_mm([CANDIDATES * place + row for place, row in views]))


def _ordinary(arm: Arm, arm_class: ArmClass, seed: int) -> Row:
    rng = np.random.default_rng([seed, 2])
    target = target_places(rng, arm, 1)
    cell = arm_cell(rng, build_arm(arm, arm_class, seed), [reachable_views(rng, arm, target[0], 12)], target)
    seen = PointsOfInterest(Postures(reachable_views(rng, arm, target[0], HELD_OUT)), draw_points(rng, HELD_OUT))
    return _measure(cell, _interest(rng, arm), np.nan, seen)


def built_of_family(arm: Arm, family: str, seed: int) -> BuiltArm:
    """An arm of the class `standard`, or of another form."""
    return build_arm(arm, "standard", seed) if family == "standard" else build_other_arm(arm, family, seed)


def _other(arm: Arm, family: str, seed: int, views: Sequence[int]) -> Row | None:
    """None where the session is refused."""
    try:
        return _measure(*jogged(arm, family, seed, views), np.nan) if views else _planned(arm, seed, family)
    except CalibrationError:
        return None


def jogged(arm: Arm, family: str, seed: int, views: Sequence[int]) -> tuple[ArmCell, PointsOfInterest]:
    """A session in one posture with as many views of each place, and where its points are held out."""
    rng = np.random.default_rng([seed, 3])
    targets = target_places(rng, arm, len(views))
    joints = [
        reachable_views(rng, arm, target, count, one_posture=True)
        for target, count in zip([*targets], views, strict=True)
    ]
    cell = arm_cell(rng, built_of_family(arm, family, seed), joints, targets)
    return cell, _interest(rng, arm)


def _measure(cell: ArmCell, interest: PointsOfInterest, bound_mm: float, seen: PointsOfInterest | None = None) -> Row:
    arm = cell.built.drawing
    plain = estimate_session(max(cell.problems, key=lambda problem: len(problem.views))).selection
    fit = identify_arm_session(arm, cell.problems)

    def compare(at: PointsOfInterest) -> tuple[float, float, float, float, float]:
        truth = map_points(cell.built.base_T_flange(at.postures) @ cell.mount_T_camera, at.points_mm[:, None])[:, 0]
        drawn = arm.forward(at.postures.joints_rad) @ plain.best.chain.mount_T_camera
        before = map_points(drawn, at.points_mm[:, None])[:, 0] - truth
        found, covariance = registered_points(fit, at.postures, at.points_mm)
        off = found - truth
        claim = float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean()))
        return rms_length(before), rms_length(off), normalised_rms(off, covariance), float(off[:, 2].mean()), claim

    before, after, normalised, high_mm, claim_mm = compare(interest)
    row = Row(fit.taken_up, before, after, bound_mm, normalised, high_mm=high_mm, claim_mm=claim_mm)
    if seen is None:
        return row
    before, after, normalised, *_ = compare(seen)
    return replace(row, seen_before_mm=before, seen_after_mm=after, seen_normalised=normalised)


def _interest(rng: np.random.Generator, arm: Arm) -> PointsOfInterest:
    return PointsOfInterest(Postures(box_postures(rng, arm, HELD_OUT)), draw_points(rng, HELD_OUT))


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


TABLES: dict[str, Callable[[range, Sequence[str]], None]] = {
    "planned": planned_table,
    "ordinary": ordinary_table,
    "others": others_table,
    "families": families_table,
    "perfect": perfect_table,
    "joint": joint_table,
    "more": more_table,
    "door": door_as_built_table,
    "speed": speed_table,
}

if __name__ == "__main__":
    main()
