"""A settings file, a daemon that serves it, and its reload."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from daemon.api.extension import Extensions
from daemon.config.settings import load_settings_file
from extensions.installed import INSTALLED
from tests.daemon.cell_under_test import Bench, serving

SETTINGS = """
[robot]
address = "tcp://robot:11111"
box_mm = [[-2000, -2000, -500], [2000, 2000, 2500]]
{robot}
[camera]
address = "http://camera/frame.png"
[target]
kind = "chessboard"
columns = 11
rows = 8
pitch_mm = 20.0
[calibration]
tolerance_mm = {tolerance}
[server]
port = 0
log_level = "{level}"
[storage]
folder = "store"
reserve_mb = 0
{more}
"""


def write(file: Path, tolerance: float = 1.0, level: str = "info", robot: str = "", more: str = "") -> None:
    file.write_text(SETTINGS.format(tolerance=tolerance, level=level, robot=robot, more=more))


@asynccontextmanager
async def serving_file(file: Path, extensions: Extensions = INSTALLED) -> AsyncIterator[Bench]:
    """The daemon; the level of the root logger, which is the process's, is put back."""
    level = logging.getLogger().level
    settings, loaded = load_settings_file(file)
    try:
        async with serving(settings, settings_file=loaded, extensions=extensions) as bench:
            yield bench
    finally:
        logging.getLogger().setLevel(level)


async def reload(bench: Bench) -> list[str]:
    """Reload; returns the warnings of /ready."""
    assert bench.application.reload is not None
    await bench.application.reload()
    warnings: list[str] = (await bench.client.get("/ready")).json()["warnings"]
    return warnings
