"""Measures two functions in alternating runs and prints the ratios as a row."""

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

Work = Callable[[], object]

WHAT, NUMBER = 44, 9


@dataclass(frozen=True)
class Cost:
    """Cost of one run: elapsed seconds, and processor seconds (with children), which other load hardly
    changes.
    """

    wall_s: float
    cpu_s: float


def cost(work: Work) -> Cost:
    began, before = time.perf_counter(), _cpu_s()
    work()
    return Cost(time.perf_counter() - began, _cpu_s() - before)


def _cpu_s() -> float:
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def best(work: Work, repeat: int = 7) -> float:
    """Shortest of some runs, in seconds."""
    return min(cost(work).wall_s for _ in range(repeat))


def heading(title: str) -> None:
    """Print the column names of the rows that follow."""
    print(f"\n{title:<{WHAT}}{'best':>{NUMBER}}{'median':>{NUMBER}}{'CPU':>{NUMBER}}  beside", flush=True)


def row(what: str, numbers: tuple[float, ...], of: str) -> None:
    cells = "".join(f"{number:{NUMBER}.2f}" for number in numbers)
    print(f"{what:<{WHAT}}{cells:<{3 * NUMBER}}  {of}", flush=True)


def beside(what: str, limit: Work, work: Work, of: str, repeat: int = 15, before: Work = lambda: None) -> None:
    """Print a row of interleaved runs: ratio of the best times, median ratio of the pairs, ratio of the least processor
    times. `before` is not timed.
    """
    limits, works = [], []
    for _ in range(repeat):
        for each, costs in ((limit, limits), (work, works)):
            before()
            costs.append(cost(each))
    fastest = min(each.wall_s for each in limits) / min(each.wall_s for each in works)
    middle = float(np.median([a.wall_s / b.wall_s for a, b in zip(limits, works, strict=True)]))
    processor = min(each.cpu_s for each in limits) / max(0.001, min(each.cpu_s for each in works))
    row(what, (fastest, middle, processor), of)


def note(text: str) -> None:
    print(f"  {text}", flush=True)


def open3d_here() -> Any:
    """Open3D, or None; installed it may still lack the system's libusb or libGL."""
    try:
        return import_module("open3d")
    except (ImportError, OSError):
        return None
