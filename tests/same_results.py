"""Digests of what the solver answers, for changes that must not change it.

    python -m tests.same_results [--sessions N] [--workers N] > before.txt
    python -m tests.same_results [--sessions N] [--workers N] | diff before.txt -

A line for each kind of session: the digest of X, its covariance, the views' states, the findings with their parameters
and effects, over fixed seeds. Numbers count to eight digits. Run it with OPENBLAS_NUM_THREADS=1.
"""

import argparse
import hashlib
import json
import zlib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

from calibration.errors import CalibrationError
from calibration.problem import Problem
from calibration.sentences.sentence import as_sentence
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from tests.simulated.described_wrongly import FAULTS, HIGH, wrong_session
from tests.simulated.fault_kinds import GROSS
from tests.simulated.faults import SETUPS
from tests.simulated.mixups import MIXUPS, OF_INTRINSICS
from tests.simulated.varied_sessions import varied

NOTHING = "nothing"
MIXED_UP = {**GROSS, **MIXUPS}
KINDS = (NOTHING, *MIXED_UP, *FAULTS)
DIGITS = 8


def problem_of(kind: str, number: int) -> Problem:
    """The session `number` of its kind: with a mix-up of varied cells, or with few views and a wrong description."""
    rng = np.random.default_rng([number, zlib.crc32(kind.encode())])
    if kind in FAULTS:
        views, setup = int(rng.integers(3, 9)), SETUPS[int(rng.integers(len(SETUPS)))]
        return wrong_session(rng, views, FAULTS[kind], HIGH, setup, "planned").problem
    session = varied(rng)
    while kind in OF_INTRINSICS and session.problem.camera is None:
        session = varied(rng)
    return session.problem if kind == NOTHING else MIXED_UP[kind](session.problem, rng).problem


def digest(solution: Solution) -> str:
    """Of all that counts in it, eight hexadecimal digits."""
    x, sure = solution.mount_T_camera, solution.uncertainty
    answers: list[Any] = [
        None if x is None else _rounded(x),
        None if sure is None else _rounded(sure.covariance),
        [(view.index, view.status, view.reason) for view in solution.views],
        [
            (finding.code, finding.severity, *map(_said, (finding.message, finding.fix)), _rounded(finding.effect_mm))
            for finding in solution.findings
        ],
    ]
    return hashlib.sha256(json.dumps(answers, sort_keys=True, default=str).encode()).hexdigest()[:8]


def _said(text: str) -> Any:
    """Id and parameters of a sentence, numbers rounded."""
    return _rounded(as_sentence(text).pair())


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _rounded(inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray):
        return _rounded(value.tolist())
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else value


def answers_of(kind: str, sessions: int) -> str:
    """The line of a kind: the digests of its sessions."""
    return f"{kind:48}{' '.join(_answers(kind, sessions))}"


def _answers(kind: str, sessions: int) -> Iterator[str]:
    for number in range(sessions):
        try:
            yield digest(solve_hand_eye(problem_of(kind, number)))
        except CalibrationError as error:
            yield f"{type(error).__name__}!"


def main() -> None:
    """Print a line for each kind of session."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=2, help="of each kind")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.workers) as pool:
        for line in pool.map(answers_of, KINDS, [given.sessions] * len(KINDS)):
            print(line, flush=True)


if __name__ == "__main__":
    main()
