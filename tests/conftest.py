"""What every room's tests share."""

import asyncio
import gc
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from hypothesis import settings

from tests.support.patience import CLOCK, PatientLoop

# How long an example takes depends on what else the machine does.
settings.register_profile("handeyed", deadline=None)
settings.load_profile("handeyed")

# Before any module of the product takes it.
pytest.MonkeyPatch().setattr(time, "monotonic", CLOCK.now_s)

ROOT = Path(__file__).resolve().parents[1]


def pytest_collection_finish() -> None:
    """Keep the tests and modules, two million objects, out of every collection of garbage to come."""
    gc.collect()
    gc.freeze()


def pytest_asyncio_loop_factories() -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """The event loop of every asynchronous test and fixture."""
    return {"patient": PatientLoop}


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real images, poses and clouds; the test is skipped when it is not there."""
    folder = Path(os.environ.get("HANDEYED_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the real data set is not at {folder}: set HANDEYED_DATA to its folder to run this test")
    return folder
