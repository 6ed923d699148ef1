"""A scanner that writes its clouds to a folder."""

from drivers.interfaces import ScannedCloud
from drivers.scanners.cloud_files import whole_cloud
from drivers.watched_folder import WatchedFolder


class FolderScanner(WatchedFolder):
    """drivers.interfaces.Scanner. A cloud is as old as its file plus `lag_s` for scanning and writing."""

    kind, suffixes, limit_s, max_bytes = "scanner", (".ply", ".pcd"), 60.0, 2**30

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """The newest complete cloud from after `newer_than_s`; raises a DeviceError."""
        media_type, content, taken_at_s = await self.newest(newer_than_s, whole_cloud)
        return ScannedCloud(content, media_type, taken_at_s)
