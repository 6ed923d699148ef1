"""Detection rate of single faults in clean sessions, and false-alarm rate of clean sessions.

Sizes are multiples of the smallest detectable fault of that kind in that session: the size at which an oracle that
knows the kind and tries all views is right in 99 of 100 such sessions (`tests.simulated.detectable_faults`).
"""

import argparse
import multiprocessing
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis.cases import NOTHING, Case, Result, causes, results_of, with_corrected_size
from benchmarks.diagnosis.imperfect import print_imperfect
from tests.simulated.fault_kinds import GROSS, KINDS, Session
from tests.simulated.faulty_sessions import PART, REAL, part_of, real_session, simulated
from tests.simulated.imperfect_sessions import IMPERFECTIONS
from tests.simulated.mixups import MIXUPS
from tests.simulated.varied_sessions import varied

FACTORS = (0.75, 1.0, 1.5, 2.0, 4.0)
REAL_FACTORS = (1.0, 1.5, 2.0, 4.0)
EVERY = 250
PLAIN = GROSS | MIXUPS
"""Faults without a size."""

PARTS = ("gross", "varied", "simulated", "real", "clean", "imperfect")
SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Small matrices: threads would wait for each other and for other processes' threads."""


@dataclass(frozen=True)
class Sizes:
    """Numbers of sessions: per row, clean ones, and per row on real sessions."""

    row: int
    clean: int
    real: int


QUICK = Sizes(20, 500, 10)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="benchmarks.diagnosis", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="half as many sessions")
    parser.add_argument("--sessions", type=int, default=40, help="simulated sessions in each row")
    parser.add_argument("--real", type=int, default=20, help="parts of each real session in each row")
    parser.add_argument("--clean", type=int, default=1000, help="clean sessions")
    parser.add_argument("--only", choices=PARTS, help="one of the parts")
    every_kind = (NOTHING, *PLAIN, *KINDS, *IMPERFECTIONS)
    parser.add_argument("--kinds", choices=every_kind, nargs="+", metavar="KIND", help="some of the rows")
    parser.add_argument("--factors", type=float, nargs="+", help="sizes, in multiples of just above the noise")
    parser.add_argument("--session", choices=REAL, help="one of the real sessions")
    parser.add_argument("--seed", type=int, default=5, help="of sessions and faults")
    parser.add_argument("--missed", action="store_true", help="print what is said where a fault is not named rightly")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes; results do not depend on it")
    options = parser.parse_args()
    parts = (options.only,) if options.only else PARTS
    sizes = QUICK if options.quick else Sizes(options.sessions, options.clean, options.real)
    os.environ.update(SINGLE_THREADED)
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        bench = Bench(pool, options.seed, tuple(options.kinds or (NOTHING, *PLAIN, *KINDS)), options.missed)
        if "gross" in parts:
            print(f"simulated sessions, 6 to 30 views, both set-ups, faults that are plain; {sizes.row} a row")
            bench.table(bench.simulate(sizes.row), PLAIN, ())
        if "varied" in parts:
            print(
                f"other boards, cameras and arms, 8 to 60 views, both set-ups, faults that are plain; {sizes.row} a row"
            )
            bench.table([_vary((options.seed, 5, number)) for number in range(sizes.row)], (NOTHING, *PLAIN), ())
        if "simulated" in parts:
            print(f"simulated sessions, 6 to 30 views, both set-ups; {sizes.row} a row")
            bench.table(bench.simulate(sizes.row), KINDS, options.factors or FACTORS)
        if "real" in parts:
            bench.real((options.session,) if options.session else REAL, sizes.real, options.factors or REAL_FACTORS)
        if "clean" in parts:
            bench.false_alarms(sizes.clean)
        if "imperfect" in parts:
            print_imperfect(pool, options.seed, sizes.row, options.kinds or tuple(IMPERFECTIONS))


@dataclass(frozen=True, eq=False)
class Bench:
    """Executor and seed of the cases, kinds to run, and whether missed cases are printed."""

    pool: Executor
    seed: int
    kinds: tuple[str, ...]
    prints_misses: bool

    def simulate(self, count: int) -> list[Session]:
        """Sessions, each from a seed of its own."""
        return [_simulate((self.seed, 0, number)) for number in range(count)]

    def real(self, names: Sequence[str], count: int, factors: Sequence[float]) -> None:
        """A table for each real session whose folder exists."""
        for name, problem in zip(names, self.pool.map(real_session, names), strict=True):
            if problem is None:
                print(f"\n{name}: the folder is not there (HANDEYED_DATA)")
                continue
            print(f"\n{name}; {count} a row; at most {PART} of its {len(problem.views)} views that agree")
            parts = [part_of(problem, np.random.default_rng([self.seed, 1, number])) for number in range(count)]
            real = [kind for kind in (*PLAIN, *KINDS) if kind in PLAIN or KINDS[kind].real]
            self.table(list(self.pool.map(with_corrected_size, parts)), real, factors)

    def table(self, sessions: Sequence[Session], kinds: Iterable[str], factors: Sequence[float]) -> None:
        """A row per kind and size: how often named correctly, wrongly, unnoticed, and the oracle."""
        print(
            f"{'fault':<40}{'size':>7}{'dev':>6}{'of':>5}{'named':>8}{'either':>8}{'wrongly':>9}{'unnoticed':>11}"
            f"{'oracle':>8}"
        )
        chosen = [kind for kind in kinds if kind in self.kinds]
        cases = [
            Case(kind, session, tuple(factors), (self.seed, 2, number))
            for kind in chosen
            for number, session in enumerate(sessions)
        ]
        found = self.pool.map(results_of, cases)
        for kind in chosen:
            by_session = [next(found) for _ in sessions]
            for size, results in enumerate(zip(*by_session, strict=True)):
                _row(kind, "gross" if kind in (NOTHING, *PLAIN) else f"x {factors[size]:g}", results)
                if self.prints_misses:
                    _print_misses(results)

    def false_alarms(self, count: int) -> None:
        """Clean sessions with a named cause; one line for every few hundred."""
        alarms = Counter[str]()
        seeds = [(self.seed, 3, number) for number in range(count)]
        for done, code in enumerate(self.pool.map(_alarm, seeds, chunksize=5), 1):
            alarms.update(code)
            if done % EVERY == 0 or done == count:
                listed = ", ".join(f"{code} {times}" for code, times in alarms.items())
                share = f"{alarms.total()} ({100 * alarms.total() / done:.1f} %)"
                print(
                    f"false alarms in {done} clean simulated sessions: {share}{f': {listed}' if listed else ''}",
                    flush=True,
                )


def _simulate(seed: tuple[int, ...]) -> Session:
    return simulated(np.random.default_rng(seed))


def _vary(seed: tuple[int, ...]) -> Session:
    return varied(np.random.default_rng(seed))


def _alarm(seed: tuple[int, ...]) -> list[str]:
    return [finding.code for finding in causes(_simulate(seed).problem)[:1]]


def _row(kind: str, size: str, results: Sequence[Result]) -> None:
    """Sessions in which the oracle cannot distinguish such faults at any size are not counted."""
    counted = [result for result in results if result.detectable]
    if not counted:
        oracle = f"{100 * np.mean([result.power for result in results]):.0f} %"
        print(f"{kind:<40}{size:>7}   not detectable: oracle {oracle}", flush=True)
        return
    outcomes = Counter(result.outcome for result in counted)
    share = {
        outcome: f"{100 * outcomes[outcome] / len(counted):.0f} %" for outcome in ("right", "either", "wrong", "none")
    }
    power, deviations = [result.power for result in counted], np.median([result.deviations for result in counted])
    print(
        f"{kind:<40}{size:>7}{'' if np.isnan(deviations) else f'{deviations:.0f}':>6}{len(counted):>5}"
        f"{share['right']:>8}{share['either']:>8}{share['wrong']:>9}{share['none']:>11}"
        f"{'' if np.isnan(deviations) else f'{100 * np.mean(power):.0f} %':>8}",
        flush=True,
    )


def _print_misses(results: Sequence[Result]) -> None:
    for number, result in enumerate(results):
        if result.detectable and result.outcome != "right":
            print(f"    session {number}: {result.outcome}; {result.said}", flush=True)
