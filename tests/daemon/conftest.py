"""A running daemon with default settings, and a heap without what other tests left, for tests that need them."""

import gc
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from tests.daemon.cell_under_test import Bench, serving, settings_for


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    """A daemon whose store is `tmp_path`, with the fake cell's devices; stopped in order after the test."""
    async with serving(settings_for(tmp_path)) as running:
        yield running


@pytest.fixture
def heap_of_a_new_process() -> Iterator[None]:
    """Without what other tests left behind, which the garbage collector would look through on the loop."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()
