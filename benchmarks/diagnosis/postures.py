"""What is named first for an arm's own errors, and for another pitch beside them.

`python -m benchmarks.diagnosis.postures [--sessions 40] [--seed 1]`

Sessions of 16 views with a standard arm as built in two postures (`tests.simulated.two_postures`), of a target as
described and of targets that are larger or smaller by the factors.
"""

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from calibration.diagnosis.convention_hypotheses import likeliest_scale
from calibration.diagnosis.diagnose import diagnose
from tests.simulated.two_postures import CENTRE_MM, two_postures

FACTORS = (1.0, 0.99, 0.997, 0.998, 0.999, 1.001, 1.002, 1.003, 1.01)


def named(job: tuple[int, float, bool]) -> str:
    """The code that is named first; "nothing" without one."""
    seed, factor, joints_known = job
    evidence = two_postures(seed).scale_target(factor)
    if not joints_known:
        evidence = replace(evidence, joints_rad=None)
    found = diagnose(evidence, CENTRE_MM, len(evidence))
    return "nothing" if found is None else found.cause.code


def apparent_share(seed: int) -> float:
    """By how much larger the described target appears because of the arm, as a logarithm."""
    return float(np.log(likeliest_scale(two_postures(seed))))


def main() -> None:
    """Print a row for each factor, with the joints known and not."""
    parser = argparse.ArgumentParser(prog="benchmarks.diagnosis.postures", description=__doc__)
    parser.add_argument("--sessions", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1, help="of the first session; the others follow")
    parser.add_argument("--factors", type=float, nargs="+", default=FACTORS, help="sizes of the target over described")
    parser.add_argument("--workers", type=int)
    given = parser.parse_args()
    print(f"standard arms in two postures, 16 views; {given.sessions} a row; what is named first")
    with ProcessPoolExecutor(given.workers) as pool:
        seeds = range(given.seed, given.seed + given.sessions)
        alone = 100 * np.array(list(pool.map(apparent_share, seeds, chunksize=2)))
        print(f"the arms alone look like {np.sqrt(np.mean(alone**2)):.3f} % (RMS), {np.abs(alone).max():.3f} % at most")
        for joints_known in (True, False):
            for factor in given.factors:
                jobs = [(given.seed + number, factor, joints_known) for number in range(given.sessions)]
                codes = Counter(pool.map(named, jobs, chunksize=2))
                listed = ", ".join(f"{code} {times}" for code, times in codes.most_common())
                print(f"joints {'known' if joints_known else 'not':<6}  size x {factor:<6g} {listed}", flush=True)


if __name__ == "__main__":
    main()
