"""One camera of the cell, with what the daemon does with it."""

from dataclasses import dataclass

from daemon.config.settings import Settings
from daemon.drift.monitor import DriftMonitor
from daemon.operations import Operations
from daemon.runtime.shared_reading import RecentReading
from daemon.sessions.look import Look
from daemon.sessions.pictures import LivePictures


@dataclass(eq=False)
class CellCamera:
    """One camera: its runs, pictures and drift chart. `settings`: with this camera in [camera], replaced by a reload.

    `obstacles`: reasons why a run with robot and this camera could not start now.
    """

    name: str
    settings: Settings
    operations: Operations
    pictures: LivePictures
    looks: RecentReading[Look]
    drift: DriftMonitor
    obstacles: RecentReading[tuple[str, ...]]
