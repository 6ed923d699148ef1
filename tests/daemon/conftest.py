"""A running daemon with default settings, for tests that need no others."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.daemon.cell_under_test import Bench, serving, settings_for


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    """A daemon whose store is `tmp_path`, with the fake cell's devices; stopped in order after the test."""
    async with serving(settings_for(tmp_path)) as running:
        yield running
