"""A scanner that writes its clouds to a folder."""

import time
from collections.abc import Callable
from pathlib import Path

from drivers.interfaces import ScannedCloud
from drivers.scanners.cloud_files import whole_cloud
from drivers.timing import Timing
from drivers.watched_folder import LAG_S, WatchedFolder

LIMIT_S = 60.0
MAX_BYTES = 2**30
SUFFIXES = (".ply", ".pcd")


class FolderScanner(WatchedFolder):
    """drivers.interfaces.Scanner. A cloud is as old as its file plus `lag_s` for scanning and writing."""

    def __init__(
        self,
        folder: Path,
        timing: Timing | None = None,
        *,
        limit_s: float = LIMIT_S,
        max_bytes: int = MAX_BYTES,
        lag_s: float = LAG_S,
        wall_clock: Callable[[], float] = time.time,
        name: str = "scanner",
    ) -> None:
        super().__init__(
            folder,
            SUFFIXES,
            timing or Timing(),
            name=name,
            limit_s=limit_s,
            max_bytes=max_bytes,
            lag_s=lag_s,
            wall_clock=wall_clock,
        )

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """The newest complete cloud from after `newer_than_s`; raises a DeviceError."""
        media_type, content, taken_at_s = await self.newest(newer_than_s, whole_cloud)
        return ScannedCloud(content, media_type, taken_at_s)
