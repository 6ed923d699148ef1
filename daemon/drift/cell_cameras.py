"""The cameras of the cell by name, each with what the daemon does with it."""

from dataclasses import dataclass

from calibration.sentences.sentence import Sentence
from daemon.config.settings import Settings
from daemon.drift.monitor import DriftMonitor
from daemon.errors import NotFound
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


@dataclass(frozen=True, eq=False)
class CellCameras:
    """All cameras, the one of [camera] first."""

    cameras: tuple[CellCamera, ...]

    @property
    def main(self) -> CellCamera:
        return self.cameras[0]

    def by_name(self, name: str | None) -> CellCamera:
        """The camera of that name, without one that of [camera]. Raises NotFound."""
        if name is None:
            return self.main
        for camera in self.cameras:
            if camera.name == name:
                return camera
        fix = Sentence("choose-of-settings", names=[camera.name for camera in self.cameras])
        raise NotFound(Sentence("no-such-camera", name=name), fix)
