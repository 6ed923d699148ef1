"""One fault in a clean session: is it named? And is a clean session left in peace?

Sizes are in deviations: what the session, by its own noise, could tell of the fault if nothing else were in question.
"""

import argparse
import os
from collections import Counter
from collections.abc import Callable, Iterator, Set
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
    deviation_of,
    in_convention,
    lens,
    mistyped,
    moved,
    other_tool,
    scaled_target,
    sign_lost,
    simulated_session,
    swapped,
    turned,
)
from calibration.diagnosis.conventions import CONVENTIONS as KNOWN_CONVENTIONS
from calibration.diagnosis.views import CHANGE_CODES
from calibration.problem import Problem
from calibration.solution import Finding
from calibration.solve import solve_hand_eye

CAUSES = CHANGE_CODES | {convention.code for convention in KNOWN_CONVENTIONS}
CAUSES |= {"poses-off-by-one", "poses-swapped", "pose-mistyped", "board-turned", "intrinsics-do-not-fit"}
CAUSES |= {"wrong-pitch", "target-scale"}
SIZES = (4, 6, 8, 10, 15, 20, 40, 100)
REAL_SIZES = (10, 20, 100)
GROSS: dict[str, Callable[[Problem, np.random.Generator], Fault]] = {
    **{code: in_convention(code) for code in CONVENTIONS},
    "two poses swapped": swapped,
    "a quaternion's sign": sign_lost,
    "board turned in one view": turned,
    "tool instead of flange from view k on": other_tool,
}
LENSES = {
    "focal length off by 0.3 %": lens(0.003, 0.0),
    "focal length off by 3 %": lens(0.03, 0.0),
    "distortion k1 off by 0.1": lens(0.0, 0.1),
}
SLIPS: dict[str, Callable[[Problem, np.random.Generator], Slip]] = {
    "one number of a position mistyped": mistyped,
    "base side moved at view k": partial(moved, what="base"),
    "flange side moved at view k": partial(moved, what="tool"),
    "pitch": scaled_target,
}

Sessions = Callable[[np.random.Generator], Problem]


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
    parser.add_argument("--clean", type=int, default=1000, help="clean sessions")
    parser.add_argument("--only", choices=("simulated", "real", "clean"), help="one of the three parts")
    options = parser.parse_args()
    parts = (options.only,) if options.only else ("simulated", "real", "clean")
    sizes = Sizes(4, 40, 2) if options.quick else Sizes(options.sessions, options.clean, max(options.sessions // 5, 1))
    if "simulated" in parts:
        print(f"simulated sessions, 6 to 30 views, both set-ups; {sizes.row} a row")
        table(simulated, sizes.row, {**GROSS, **LENSES}, real=False)
    if "real" in parts:
        for name, problem in real_sessions():
            print(f"\n{name}; {sizes.real} a row")
            table(partial(part_of, problem), sizes.real, GROSS, real=True)
    if "clean" in parts:
        print(f"\nfalse alarms in {sizes.clean} clean simulated sessions: {false_alarms(sizes.clean)}")


def simulated(rng: np.random.Generator) -> Problem:
    """Issue-like noise: 0.02 to 0.5 px, up to 0.5 mm and 0.05 degrees."""
    noise = Noise(rng.choice([0.02, 0.1, 0.5]), *((0, 0), (0.05, 0.005), (0.5, 0.05))[rng.integers(3)])
    return simulated_session(rng, int(rng.integers(6, 31)), noise, SETUPS[rng.integers(2)])


def part_of(problem: Problem, rng: np.random.Generator) -> Problem:
    """At most 20 views of a real session, one after the other, numbered anew."""
    start = int(rng.integers(max(len(problem.views) - 20, 0) + 1))
    chosen = problem.views[start : start + 20]
    return replace(problem, views=tuple(replace(view, index=index) for index, view in enumerate(chosen)))


def real_sessions() -> Iterator[tuple[str, Problem]]:
    """The folders that are there, with the views that agree, and the camera that fits them."""
    from daemon.session_folder import load_problem, open_session

    root = Path(os.environ.get("HANDEYED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    for name in ("ic_charuco", "ic_circles", "metric_1"):
        if (root / name).is_dir():
            problem = load_problem(open_session(root / name))
            solution = solve_hand_eye(problem)
            agreeing = {result.index for result in solution.views if result.status != "rejected"}
            views = tuple(view for view in problem.views if view.index in agreeing)
            yield name, replace(problem, views=views, camera=solution.camera)
        else:
            print(f"\n{name}: the folder is not there (HANDEYED_DATA)")


def table(
    sessions: Sessions, count: int, gross: dict[str, Callable[[Problem, np.random.Generator], Fault]], real: bool
) -> None:
    """A row for each kind and size: how often named rightly, wrongly, not noticed."""
    print(f"{'fault':<40}{'size':>8}{'named':>8}{'either':>8}{'wrongly':>9}{'unnoticed':>11}")
    chosen: list[tuple[Problem, frozenset[str]]] = []
    rng = np.random.default_rng(1)
    for _ in range(count):
        session = sessions(rng)
        chosen.append((session, frozenset(finding.code for finding in causes(session)) if real else frozenset()))
    for name, put in gross.items():
        rng = np.random.default_rng(2)
        _row(name, "gross", Counter(named(put(session, rng), before) for session, before in chosen))
    for name, slip_of in SLIPS.items():
        for size in REAL_SIZES if real else SIZES:
            rng = np.random.default_rng(2)
            slips = [(slip_of(session, rng), session, before) for session, before in chosen]
            faults = ((slip.at(size * deviation_of(session, slip)), before) for slip, session, before in slips)
            _row(name, f"{size} dev", Counter(named(fault, before) for fault, before in faults))


def _row(name: str, size: str, outcomes: "Counter[str]") -> None:
    share = {
        outcome: f"{100 * outcomes[outcome] / outcomes.total():.0f} %"
        for outcome in ("right", "either", "wrong", "none")
    }
    print(
        f"{name:<40}{size:>8}{share['right']:>8}{share['either']:>8}{share['wrong']:>9}{share['none']:>11}", flush=True
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


def false_alarms(count: int) -> str:
    """Clean sessions in which a cause is named all the same."""
    rng = np.random.default_rng(3)
    alarms = Counter[str]()
    for _ in range(count):
        alarms.update(finding.code for finding in causes(simulated(rng))[:1])
    listed = ", ".join(f"{code} {times}" for code, times in alarms.items())
    return f"{alarms.total()} ({100 * alarms.total() / count:.1f} %)" + (f": {listed}" if listed else "")


if __name__ == "__main__":
    main()
