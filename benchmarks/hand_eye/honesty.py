"""`python -m benchmarks.hand_eye.honesty [--sessions N] [--seed S] [--workers N] [--by fault|views]`

Whether U holds where print, lens or arm are not as described: sessions of every fault, 3 to 8 views, eye-in-hand and
eye-to-hand, low and high noise, planned and random poses. e: largest error of the 27 points of the working volume, in
the arm's millimetres; U (k = 2) at the worst of them. A session counts where it is accepted at a tolerance of 4 mm.
"""

import argparse
import os
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from time import process_time

import numpy as np

from calibration.problem import Setup
from calibration.solve import estimate_hand_eye, solve_hand_eye
from calibration.transforms import map_points
from calibration.verdict import DEFAULT_VERDICT_LIMITS, judge
from tests.simulated.described_wrongly import FAULTS, HIGH, LOW, Poses, wrong_session

VIEWS = (3, 4, 5, 6, 8)
SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
POSES: tuple[Poses, ...] = ("planned", "random")
LEVELS = {"low": LOW, "high": HIGH}
NEGLIGIBLE_MM, GROSS_MM, TOLERANCE_MM = 0.2, 2.0, 4.0


@dataclass(frozen=True)
class Asked:
    """One session of the table."""

    fault: str
    views: int
    level: str
    setup: Setup
    poses: Poses
    seed: int
    diagnosed: bool


@dataclass(frozen=True)
class Answered:
    """What came of it: error and U, mm; the codes of the findings that refused it; processor time, s."""

    of: Asked
    accepted: bool
    error_mm: float
    expanded_mm: float
    refused_for: tuple[str, ...]
    seconds: float


def answer(asked: Asked) -> Answered:
    """Solve one session and compare X with the truth."""
    rng = np.random.default_rng(asked.seed)
    session = wrong_session(rng, asked.views, FAULTS[asked.fault], LEVELS[asked.level], asked.setup, asked.poses)
    begin = process_time()
    solution = solve_hand_eye(session.problem) if asked.diagnosed else estimate_hand_eye(session.problem)
    seconds = process_time() - begin
    verdict = judge(session.problem, solution, replace(DEFAULT_VERDICT_LIMITS, tolerance_mm=TOLERANCE_MM))
    errors = tuple(finding.code for finding in verdict.findings if finding.severity == "error")
    if solution.mount_T_camera is None or solution.uncertainty is None:
        return Answered(asked, False, np.inf, np.inf, errors, seconds)
    points = np.array([point.camera_mm for point in solution.uncertainty.points])
    off = map_points(solution.mount_T_camera, points) - map_points(session.mount_T_camera, points)
    worst = solution.uncertainty.worst_point.expanded_mm
    return Answered(asked, verdict.accepted, float(np.linalg.norm(off, axis=1).max()), worst, errors, seconds)


def questions(sessions: int, seed: int, faults: Sequence[str], *, diagnosed: bool) -> list[Asked]:
    """At least so many sessions, the same number of each kind."""
    kinds = list(product(faults, VIEWS, LEVELS, SETUPS, POSES))
    rounds = -(-sessions // len(kinds))
    return [
        Asked(*kind, seed=seed + number, diagnosed=diagnosed)
        for number, kind in enumerate(kind for _ in range(rounds) for kind in kinds)
    ]


def summary(answers: Sequence[Answered]) -> str:
    """Accepted share, how often e is beyond U and 1.5 U, and the spread of e over U."""
    kept = [one for one in answers if one.accepted]
    errors = np.array([one.error_mm for one in kept])
    stated = np.array([one.expanded_mm for one in kept])
    if not kept:
        return f"{len(answers):5d}    0.0 %"
    beyond = errors > stated
    far = (errors > 1.5 * stated) & (errors > NEGLIGIBLE_MM)
    gross = (errors > 2 * stated) & (errors > GROSS_MM)
    spread = float(np.sqrt(np.mean((2 * errors / stated) ** 2)))
    return (
        f"{len(answers):5d} {100 * len(kept) / len(answers):6.1f} % {100 * beyond.mean():6.2f} %"
        f" {100 * far.mean():6.2f} % {int(gross.sum()):4d} {spread:6.2f} {np.median(errors):7.3f}"
        f" {np.median(stated):7.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--faults", nargs="*", default=list(FAULTS))
    parser.add_argument("--worst", type=int, default=0, help="list so many of the worst sessions")
    parser.add_argument("--no-diagnosis", action="store_true", help="the estimate alone, in a quarter of the time")
    given = parser.parse_args()
    with ProcessPoolExecutor(given.workers) as pool:
        answers = list(
            pool.map(
                answer,
                questions(given.sessions, given.seed, given.faults, diagnosed=not given.no_diagnosis),
                chunksize=4,
            )
        )
    keys: dict[str, Callable[[Asked], str]] = {
        "all": lambda of: "all sessions",
        "views": lambda of: f"{of.views} views",
        "noise": lambda of: f"{of.level} noise",
        "setup": lambda of: of.setup,
        "poses": lambda of: f"{of.poses} poses",
        "fault": lambda of: of.fault,
        "clean": lambda of: f"clean, {of.level}, {of.views} views" if of.fault == "none" else "",
    }
    print(
        f"{'':24s} {'n':>5s} {'accepted':>8s} {'e > U':>8s} {'e>1.5U':>8s} {'>2U':>4s} {'2e/U':>6s}"
        f" {'e mm':>7s} {'U mm':>7s}"
    )
    for key in keys.values():
        groups: dict[str, list[Answered]] = defaultdict(list)
        for one in answers:
            groups[key(one.of)].append(one)
        for name, group in groups.items():
            if name:
                print(f"{name:24s} {summary(group)}")
    refused: dict[str, int] = defaultdict(int)
    for one in answers:
        for code in one.refused_for:
            refused[code] += 1
    print("refused for:", ", ".join(f"{code} {count}" for code, count in sorted(refused.items(), key=lambda x: -x[1])))
    print(f"processor time of a session, median {np.median([one.seconds for one in answers]):.3f} s")
    for one in sorted((a for a in answers if a.accepted), key=lambda a: -a.error_mm / a.expanded_mm)[: given.worst]:
        print(f"e {one.error_mm:.2f} U {one.expanded_mm:.2f} {one.of}")


if __name__ == "__main__":
    main()
