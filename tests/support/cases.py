"""How many cases a property is tried with."""

import os


def cases(normal: int) -> int:
    """`normal`, or what HANDEYED_CASES says when that is more: HANDEYED_CASES=100000 is the long run."""
    return max(normal, int(os.environ.get("HANDEYED_CASES", "0")))


def long_enough_s(normal: float = 120.0) -> float:
    """The time limit of one test: it grows with what HANDEYED_CASES asks for."""
    return max(normal, 0.02 * cases(0))
