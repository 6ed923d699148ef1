"""A running daemon with default settings, and computations that many runs share."""

from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from calibration.planning.what_if import PlanComparison
from daemon.runs import calibration_run
from daemon.sessions import session_writer
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.support.remembering import remembering


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    """A daemon whose store is `tmp_path`, with the fake cell's devices; stopped in order after the test."""
    async with serving(settings_for(tmp_path)) as running:
        yield running


@pytest.fixture(scope="session", autouse=True)
def computed_once() -> Iterator[None]:
    """The fake camera shows equal pictures in many tests: each is detected, each session solved once in a process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session_writer, "detect", remembering(session_writer.detect))
        patch.setattr(calibration_run, "solve_hand_eye", remembering(calibration_run.solve_hand_eye))
        patch.setattr(PlanComparison, "findings", remembering(PlanComparison.findings))
        yield
