"""What is accepted of damaged sessions, and how far off it is: `python -m benchmarks.diagnosis.damaged`.

Sessions of `tests/simulated/damage.py` by their seeds, which are those of tests/calibration/test_damaged_sessions.py.
An error that is no refusal ends the program with its traceback.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from calibration.solve import solve_hand_eye
from calibration.verdict import judge
from tests.simulated.damage import damaged_session
from tests.simulated.damage_excess import excess, intact_excess

MULTIPLES = (1, 2, 3)


def accepted_excess(seed: int) -> tuple[float, float] | None:
    """RMS error of points over its standard deviation, and that of the undamaged views alone where it is beyond
    three; None for a refused session."""
    session = damaged_session(np.random.default_rng(seed))
    solution = solve_hand_eye(session.problem)
    if not judge(session.problem, solution).accepted:
        return None
    found, nearest = excess(session, solution)
    return found, intact_excess(session, nearest) if found > MULTIPLES[-1] else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=7_100_000, help="of the first session; each next one has the next")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.sessions)
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        results = list(pool.map(accepted_excess, seeds, chunksize=10))
    accepted = {seed: one for seed, one in zip(seeds, results, strict=True) if one is not None}
    off = np.array([found for found, _ in accepted.values()])
    shares = ", ".join(f"{100 * np.mean(off > multiple):.1f} % by more than {multiple}" for multiple in MULTIPLES)
    print(f"{len(seeds):,} damaged sessions: {len(accepted):,} accepted, off by uncertainties (k = 1): {shares}")
    for seed, (found, intact) in accepted.items():
        if found > MULTIPLES[-1]:
            print(f"session {seed}: {found:.2f}; its undamaged views alone {intact:.2f}")


if __name__ == "__main__":
    main()
