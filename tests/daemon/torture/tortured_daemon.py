"""The daemon that is tortured: what runs in a plant, with the tests' devices and a crash in its future."""

import asyncio
import logging
import os
import signal
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import uvloop

from daemon.runtime.failpoints import PLACES
from tests.daemon.cell_under_test import Parts, serving, settings_for

WARM = ["tests.daemon.torture.tortured_daemon", "anyio._backends._asyncio", "uvicorn.lifespan.on", "websockets.server",
        "uvicorn.protocols.websockets.websockets_sansio_impl", "scipy.optimize"]  # fmt: skip
"""What a forked daemon need not import again."""

STATIONS = 3


@dataclass
class KillAt:
    """Ends this process the n-th time a place is reached. `told`: a file with a byte for each place reached."""

    place: str
    nth: int
    told: int
    seen: dict[str, int] = field(default_factory=lambda: dict.fromkeys(PLACES, 0))

    def __call__(self, place: str) -> None:
        os.write(self.told, bytes([PLACES.index(place)]))
        self.seen[place] += 1
        if place == self.place and self.seen[place] == self.nth:
            os.kill(os.getpid(), signal.SIGKILL)


def daemon_process(folder: str, place: str, nth: int, ready: Connection) -> None:
    """Beside the store lie `moves`, a line for each move of the arm, and `places`, a byte for each place reached."""
    logging.getLogger().addHandler(logging.NullHandler())
    places = os.open(Path(folder).with_name("places"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
    uvloop.run(_daemon(Path(folder), KillAt(place, nth, places), ready))


async def _daemon(folder: Path, at: KillAt, ready: Connection) -> None:
    parts, moves = Parts(), folder.with_name("moves")

    async def move(number: int) -> None:
        with moves.open("a") as file:
            file.write(f"{number}\n")

    parts.robot.before_move = move
    poses = settings_for(folder).calibration.poses[:STATIONS]
    settings = settings_for(folder, calibration={"poses": [pose.model_dump() for pose in poses]})
    async with serving(settings, parts, at=at) as bench:
        ready.send(bench.url)
        await asyncio.Event().wait()
