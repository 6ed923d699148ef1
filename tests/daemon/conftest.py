"""A running daemon with default settings, its solver's results, and a heap without what other tests left."""

import gc
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.support.computed_once import ComputedOnce


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    """A daemon whose store is `tmp_path`, with the fake cell's devices; stopped in order after the test."""
    async with serving(settings_for(tmp_path)) as running:
        yield running


@pytest.fixture(scope="session")
def computed_results() -> Iterator[list[ComputedOnce]]:
    """Detections, recognised targets, solutions, expected accuracies and comparisons with planned poses, computed once.

    The fake cell's pictures depend on nothing but its poses: without this every run would solve the same problem.
    """
    from calibration.detection import detect as detection
    from calibration.detection import recognition
    from calibration.planning.what_if import PlanComparison
    from calibration.solve import solve_hand_eye
    from daemon.tools.first_setup import expected

    find = PlanComparison.findings
    detect, solve = ComputedOnce(detection.detect), ComputedOnce(solve_hand_eye)
    recognise, expect = ComputedOnce(recognition.recognise), ComputedOnce(expected.expected_mm)
    compare = ComputedOnce(lambda *arguments: tuple(find(*arguments)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(detection, "detect", detect)
        patch.setattr(recognition, "recognise", recognise)
        patch.setattr(expected, "expected_mm", expect)
        patch.setattr("calibration.solve.solve_hand_eye", solve)
        patch.setattr(PlanComparison, "findings", lambda *arguments: iter(compare(*arguments)))
        yield [detect, recognise, solve, expect, compare]


@pytest.fixture(autouse=True)
def each_problem_is_solved_once(computed_results: list[ComputedOnce]) -> None:
    """For every test of this room."""


@pytest.fixture
def computed_each_time(computed_results: list[ComputedOnce]) -> Iterator[None]:
    """For a test of what else happens while the daemon computes."""
    for function in computed_results:
        function.keeps = False
    yield
    for function in computed_results:
        function.keeps = True


@pytest.fixture
def heap_of_a_new_process() -> None:
    """Without what other tests left behind, which the garbage collector would look through on the loop.

    It stays out of later collections: to unfreeze it would give them all modules and tests to look through.
    """
    gc.collect()
    gc.freeze()
