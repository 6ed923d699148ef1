"""One fault in a clean session: is it named? And is a clean session left in peace?

Sizes are multiples of where a fault of that kind begins to stand above the noise of that very session: where an oracle
that is told the kind, and tries all views, is right in 99 of 100 such sessions (`benchmarks.diagnosis_oracle`).
"""

import argparse
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.diagnosis_faults import (
    CONVENTIONS,
    SETUPS,
    Fault,
    Noise,
    Slip,
    distortion_wrong,
    focal_wrong,
    in_convention,
    mistyped,
    moved,
    other_tool,
    poses_of,
    scaled_target,
    sign_lost,
    simulated_session,
    swapped,
    turned,
    with_poses,
)
from benchmarks.diagnosis_oracle import Reach, lens_reach, mistyped_reach, moved_reach, scale_reach
from calibration.diagnosis.conventions import CONVENTIONS as KNOWN_CONVENTIONS
from calibration.diagnosis.views import CHANGE_CODES
from calibration.problem import Problem
from calibration.solution import Finding
from calibration.solve import estimated, solve_hand_eye
from calibration.transforms import Array, transform

CAUSES = CHANGE_CODES | {convention.code for convention in KNOWN_CONVENTIONS}
CAUSES |= {"poses-off-by-one", "poses-swapped", "pose-mistyped", "board-turned", "intrinsics-do-not-fit"}
CAUSES |= {"wrong-pitch", "target-scale"}
FACTORS = (0.75, 1.0, 1.5, 2.0, 4.0)
REAL_FACTORS = (1.0, 1.5, 2.0, 4.0)
EVERY = 250
REAL = ("ic_charuco", "ic_circles", "metric_1")
PARTS = ("gross", "simulated", "real", "clean")
Put = Callable[[Problem, np.random.Generator], Fault]
GROSS: dict[str, Put] = {
    **{code: in_convention(code) for code in CONVENTIONS},
    "two poses swapped": swapped,
    "a quaternion's sign": sign_lost,
    "board turned in one view": turned,
    "tool instead of flange from view k on": other_tool,
}
FOCAL, K1 = np.repeat([1.0, 0.0], [2, 7]), np.eye(9)[4]


@dataclass(frozen=True, eq=False)
class Session:
    """`noise`: the true levels, None for a real one; `before`: what is said of it while nothing is wrong."""

    problem: Problem
    noise: Noise | None
    before: frozenset[str] = frozenset()


def _lens(change: Array, session: Session, _: Slip) -> Reach:
    camera = session.problem.camera
    assert camera is not None and session.noise is not None
    focal = np.array([camera.matrix[0, 0], camera.matrix[1, 1], *np.ones(7)])
    return lens_reach(session.problem, change * focal, session.noise.image_px)


@dataclass(frozen=True)
class Kind:
    """How to make a fault of any size, and where it stands above a session's noise."""

    slip_of: Callable[[Problem, np.random.Generator], Slip]
    reach: Callable[[Session, Slip], Reach]
    real: bool = True


LEAST_MM = 0.1
"""Ten times what the best robots repeat: less is no fault, however exact a simulated robot is."""


def _by(reach: Callable[[Problem, Slip, Noise | None], Reach], least: float = 0.0) -> Callable[[Session, Slip], Reach]:
    def above_noise(session: Session, slip: Slip) -> Reach:
        found = reach(session.problem, slip, session.noise)
        return replace(found, least=least / found.deviation)

    return above_noise


KINDS = {
    "one number of a position mistyped": Kind(mistyped, _by(mistyped_reach, LEAST_MM)),
    "base side moved at view k": Kind(partial(moved, what="base"), _by(moved_reach, LEAST_MM)),
    "flange side moved at view k": Kind(partial(moved, what="tool"), _by(moved_reach, LEAST_MM)),
    "pitch": Kind(scaled_target, _by(scale_reach)),
    "focal length": Kind(focal_wrong, partial(_lens, FOCAL), real=False),
    "distortion k1": Kind(distortion_wrong, partial(_lens, K1), real=False),
}

Sessions = Callable[[np.random.Generator], Session]


@dataclass(frozen=True)
class Sizes:
    """How many sessions: for each row, of clean ones, and for each row on real sessions."""

    row: int
    clean: int
    real: int


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="benchmarks.diagnosis", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few sessions, for a look")
    parser.add_argument("--sessions", type=int, default=40, help="simulated sessions in each row")
    parser.add_argument("--real", type=int, default=20, help="parts of each real session in each row")
    parser.add_argument("--clean", type=int, default=1000, help="clean sessions")
    parser.add_argument("--only", choices=PARTS, help="one of the parts")
    parser.add_argument("--factors", type=float, nargs="+", help="sizes, in multiples of just above the noise")
    parser.add_argument("--session", choices=REAL, help="one of the real sessions")
    parser.add_argument("--seed", type=int, default=3, help="of the clean sessions")
    options = parser.parse_args()
    parts = (options.only,) if options.only else PARTS
    sizes = Sizes(4, 40, 2) if options.quick else Sizes(options.sessions, options.clean, options.real)
    if "gross" in parts:
        print(f"simulated sessions, 6 to 30 views, both set-ups, faults that are plain; {sizes.row} a row")
        table(simulated, sizes.row, GROSS, ())
    if "simulated" in parts:
        print(f"simulated sessions, 6 to 30 views, both set-ups; {sizes.row} a row")
        table(simulated, sizes.row, {}, options.factors or FACTORS)
    if "real" in parts:
        for name, problem in real_sessions():
            if options.session in (None, name):
                print(f"\n{name}; {sizes.real} a row; at most 20 of its {len(problem.views)} views that agree")
                table(partial(part_of, problem), sizes.real, GROSS, options.factors or REAL_FACTORS)
    if "clean" in parts:
        false_alarms(sizes.clean, options.seed)


def simulated(rng: np.random.Generator) -> Session:
    """Issue-like noise: 0.02 to 0.5 px, up to 0.5 mm and 0.05 degrees."""
    noise = Noise(rng.choice([0.02, 0.1, 0.5]), *((0, 0), (0.05, 0.005), (0.5, 0.05))[rng.integers(3)])
    return Session(simulated_session(rng, int(rng.integers(6, 31)), noise, SETUPS[rng.integers(2)]), noise)


def part_of(problem: Problem, rng: np.random.Generator) -> Session:
    """At most 20 views of a real session, one after the other, numbered anew."""
    start = int(rng.integers(max(len(problem.views) - 20, 0) + 1))
    chosen = problem.views[start : start + 20]
    part = replace(problem, views=tuple(replace(view, index=index) for index, view in enumerate(chosen)))
    return Session(part, None, frozenset(finding.code for finding in causes(part)))


def real_sessions() -> Iterator[tuple[str, Problem]]:
    """The folders that are there: views that agree, the camera that fits, travel in units of the target as it is.

    A slip of the pitch that undoes the session's own would be no fault.
    """
    from daemon.session_folder import load_problem, open_session

    root = Path(os.environ.get("HANDEYED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    for name in REAL:
        if (root / name).is_dir():
            problem = load_problem(open_session(root / name))
            solution = solve_hand_eye(problem)
            agreeing = {result.index for result in solution.views if result.status != "rejected"}
            views = tuple(view for view in problem.views if view.index in agreeing)
            clean = replace(problem, views=views, camera=solution.camera)
            poses, size = poses_of(clean), estimated(problem)[2].best.scale
            yield name, with_poses(clean, transform(poses[:, :3, :3], poses[:, :3, 3] / size))
        else:
            print(f"\n{name}: the folder is not there (HANDEYED_DATA)")


def table(sessions: Sessions, count: int, gross: "dict[str, Put]", factors: Sequence[float]) -> None:
    """A row for each kind and size: how often named rightly, wrongly, not noticed, and the oracle."""
    print(f"{'fault':<40}{'size':>8}{'dev':>6}{'named':>8}{'either':>8}{'wrongly':>9}{'unnoticed':>11}{'oracle':>8}")
    rng = np.random.default_rng(1)
    chosen = [sessions(rng) for _ in range(count)]
    for name, put in gross.items():
        rng = np.random.default_rng(2)
        _row(name, "gross", "", Counter(named(put(session.problem, rng), session.before) for session in chosen), "")
    for name, kind in KINDS.items() if factors else ():
        if not kind.real and chosen[0].noise is None:
            continue
        rng = np.random.default_rng(2)
        slips = [kind.slip_of(session.problem, rng) for session in chosen]
        reaches = [kind.reach(session, slip) for session, slip in zip(chosen, slips, strict=True)]
        for factor in factors:
            outcomes, power = Counter[str](), []
            for session, slip, reach in zip(chosen, slips, reaches, strict=True):
                size = factor * reach.size
                outcomes[named(slip.at(size * reach.deviation), session.before)] += 1
                power.append(reach.power(size))
            middle = f"{np.median([factor * reach.size for reach in reaches]):.0f}"
            _row(name, f"x {factor:g}", middle, outcomes, f"{100 * np.mean(power):.0f} %")


def _row(name: str, size: str, deviations: str, outcomes: "Counter[str]", oracle: str) -> None:
    share = {
        outcome: f"{100 * outcomes[outcome] / outcomes.total():.0f} %"
        for outcome in ("right", "either", "wrong", "none")
    }
    print(
        f"{name:<40}{size:>8}{deviations:>6}{share['right']:>8}{share['either']:>8}{share['wrong']:>9}"
        f"{share['none']:>11}{oracle:>8}",
        flush=True,
    )


def named(fault: Fault, before: Set[str]) -> str:
    """Right, when the cause is named with its views; either, when it is told to be nearly as likely as another.

    What is said of the clean session, the codes `before`, does not count against it.
    """
    found = [finding for finding in causes(fault.problem) if finding.code in fault.codes or finding.code not in before]
    if not found:
        return "none"
    right = [f for f in found if f.code in fault.codes and all(word in f.message for word in fault.says)]
    if right:
        return "right"
    return "either" if any(fault.says and all(word in f.message for word in fault.says) for f in found) else "wrong"


def causes(problem: Problem) -> list[Finding]:
    """What the solver says is wrong with a session."""
    return [finding for finding in solve_hand_eye(problem).findings if finding.code in CAUSES]


def false_alarms(count: int, seed: int) -> None:
    """Clean sessions in which a cause is named all the same; a line for every few hundred."""
    rng = np.random.default_rng(seed)
    alarms = Counter[str]()
    for done in range(1, count + 1):
        alarms.update(finding.code for finding in causes(simulated(rng).problem)[:1])
        if done % EVERY == 0 or done == count:
            listed = ", ".join(f"{code} {times}" for code, times in alarms.items())
            share = f"{alarms.total()} ({100 * alarms.total() / done:.1f} %)"
            print(
                f"false alarms in {done} clean simulated sessions: {share}{f': {listed}' if listed else ''}", flush=True
            )


if __name__ == "__main__":
    main()
