"""Sessions without a fault, a little outside the model: how many are refused, and whether X lies within its U."""

from collections import Counter
from collections.abc import Collection
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from benchmarks.hand_eye.cells import bound_of
from calibration.solution import COVERAGE_FACTOR, Solution
from calibration.solve import solve_hand_eye
from calibration.verdict import VerdictLimits, judge
from tests.simulated.imperfect_sessions import (
    IMPERFECTIONS,
    imperfect_cell,
)

MAX_LISTED = 8
"""Most refused sessions that are listed by their numbers."""

LIMITS = VerdictLimits().with_tolerance(4.0)
"""Above U of these sessions, so that only a cause that is none refuses one."""


@dataclass(frozen=True)
class Outcome:
    """Codes that refuse a session or warn; U (k = 2) and true error of a measured point, mm.

    `bound_mm`: U by the Cramér-Rao bound of the same poses and noise without the imperfection.
    """

    number: int

    refused_for: tuple[str, ...]
    warned_of: tuple[str, ...]
    expanded_mm: float
    error_mm: float
    bound_mm: float


def print_imperfect(pool: Executor, seed: int, count: int, kinds: Collection[str] = tuple(IMPERFECTIONS)) -> None:
    """A row for each kind, and one of all."""
    print(f"sessions without a fault, a little outside the model; {count} a row; U: k = 2, of a measured point")
    print(f"{'imperfection':<32}{'refused':>9}{'within U':>10}{'error/u':>9}{'U mm':>8}{'U/bound':>9}  refused for")
    every: list[Outcome] = []
    for kind in kinds:
        jobs = [(kind, (seed, 4, number)) for number in range(count)]
        found = list(pool.map(outcome_of, jobs, chunksize=5))
        print(_row(kind, found), flush=True)
        every += found
    print(_row("all", every), flush=True)


def outcome_of(job: tuple[str, tuple[int, ...]]) -> Outcome:
    """Solve and judge the session of this kind and seed."""
    kind, seed = job
    imperfect = imperfect_cell(seed, IMPERFECTIONS[kind])
    problem = imperfect.cell.problem
    solution = solve_hand_eye(problem)
    verdict = judge(problem, solution, LIMITS)
    codes = {
        severity: tuple(sorted(finding.code for finding in verdict.findings if finding.severity == severity))
        for severity in ("error", "warning")
    }
    bound = bound_of(imperfect.cell, imperfect.noise)
    return Outcome(
        seed[-1],
        codes["error"],
        codes["warning"],
        _expanded_mm(solution),
        imperfect.point_error_mm(solution),
        COVERAGE_FACTOR * bound.point_mm,
    )


def _expanded_mm(solution: Solution) -> float:
    return np.nan if solution.uncertainty is None else COVERAGE_FACTOR * solution.uncertainty.point_mm


def _row(kind: str, found: list[Outcome]) -> str:
    refused = Counter(code for outcome in found for code in outcome.refused_for)
    share = np.mean([bool(outcome.refused_for) for outcome in found])
    expanded, error, exact = (
        np.array([getattr(outcome, name) for outcome in found]) for name in ("expanded_mm", "error_mm", "bound_mm")
    )
    known = np.isfinite(expanded)
    within = np.mean(error[known] <= expanded[known])
    ratio = np.sqrt(np.mean((COVERAGE_FACTOR * error[known] / expanded[known]) ** 2))
    width = np.median(expanded[known]) / np.median(exact[np.isfinite(exact)])
    listed = ", ".join(f"{code} {times}" for code, times in refused.most_common())
    numbers = [outcome.number for outcome in found if outcome.refused_for][:MAX_LISTED]
    listed += f" (sessions {', '.join(map(str, numbers))})" if numbers else ""
    return (
        f"{kind:<32}{100 * share:7.1f} %{100 * within:8.1f} %{ratio:9.2f}{np.median(expanded[known]):8.3f}{width:9.2f}"
        f"  {listed}"
    )
