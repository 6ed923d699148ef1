"""How many cases a property is tried with, and a test of a program that may be absent."""

import os
import shutil
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from itertools import product
from typing import Any, TypeVar

Case = TypeVar("Case")


def cases(normal: int) -> int:
    """`normal`, or what HANDEYED_CASES says when that is more: HANDEYED_CASES=100000 is the long run."""
    return max(normal, int(os.environ.get("HANDEYED_CASES", "0")))


def by_night() -> bool:
    """Whether statistics are tried whole, as `make test-night` does (HANDEYED_NIGHT=1)."""
    return os.environ.get("HANDEYED_NIGHT") == "1"


def seeds(count: int, every: int = 3) -> range:
    """The seeds of a statistic: every third, or another share, of 0 to `count` - 1, by night all of them."""
    return range(0, count, 1 if by_night() else every)


def crossed(*axes: Iterable[Any]) -> list[tuple[Any, ...]]:
    """The cases of parameters that are independent: each value beside those of the others in turn, by night beside all.

    Two of as many values go in step.
    """
    values = [[*axis] for axis in axes]
    if by_night():
        return [*product(*values)]
    return [tuple(axis[number % len(axis)] for axis in values) for number in range(max(map(len, values)))]


def long_enough_s(normal: float = 120.0) -> float:
    """The time limit of one test: it grows with what HANDEYED_CASES asks for."""
    return max(normal, 0.02 * cases(0))


def with_library(module: str, cases: Sequence[Case]) -> Sequence[Case]:
    """The cases of a test that needs a library; one where it is not installed, so that its skip is counted once."""
    return cases if find_spec(module) else cases[:1]


def with_program(program: str, cases: Sequence[Case]) -> Sequence[Case]:
    """The cases of a test that needs a program; one where it is not installed."""
    return cases if shutil.which(program) else cases[:1]
