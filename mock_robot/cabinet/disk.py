"""The controller's disk in memory: HOME, TEMP and the RAM disk, under all names programs and clients use for them."""

from dataclasses import dataclass, field

RAMDISK_PATH = "/bd0/ramdisk"
VOLUMES = {"home": "HOME", "temp": "TEMP", "backup": "BACKUP", "ramdisk": "RAMDISK", "bd0/ramdisk": "RAMDISK"}


class NoVolume(Exception):
    """The first part of the path is not a volume."""


@dataclass
class Disk:
    """Files by canonical path such as `HOME/handeyed/CELL_shared.sys`, and the folders that were made."""

    files: dict[str, bytes] = field(default_factory=dict)
    folders: set[str] = field(default_factory=set)

    def canonical(self, path: str) -> str:
        """Canonical key of `$HOME/x`, `HOME:/x`, `HOME/x` or `/bd0/ramdisk/x`. Raises NoVolume."""
        parts = [part for part in path.replace("\\", "/").replace(":", ":/").split("/") if part]
        for taken in (1, 2):
            volume = VOLUMES.get("/".join(parts[:taken]).strip("$:").lower())
            if volume is not None:
                return "/".join([volume, *parts[taken:]])
        raise NoVolume(path)

    def has_folder(self, path: str) -> bool:
        """Whether the folder exists: a volume, or one that was made or holds a file."""
        holds = any(each.startswith(path + "/") for each in (*self.files, *self.folders))
        return path in VOLUMES.values() or path in self.folders or holds
