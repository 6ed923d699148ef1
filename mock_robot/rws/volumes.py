"""The controller's disk in memory: HOME, TEMP and the RAM disk, under all names clients use for them."""

from dataclasses import dataclass, field

from mock_robot.rws.exchange import Item

RAMDISK_PATH = "/bd0/ramdisk"
_VOLUMES = {"home": "HOME", "temp": "TEMP", "ramdisk": "RAMDISK", "bd0/ramdisk": "RAMDISK"}


class NoVolume(Exception):
    """The first part of the path is not a volume."""


@dataclass
class Volumes:
    """Files by canonical path such as `HOME/handeyed/CELL_shared.sys`, and the folders that were made."""

    files: dict[str, bytes] = field(default_factory=dict)
    folders: set[str] = field(default_factory=set)

    def canonical(self, path: str) -> str:
        """Canonical key of `$HOME/x`, `HOME:/x`, `HOME/x` or `/bd0/ramdisk/x`. Raises NoVolume."""
        parts = [part for part in path.replace("\\", "/").split("/") if part]
        for taken in (1, 2):
            volume = _VOLUMES.get("/".join(parts[:taken]).strip("$:").lower())
            if volume is not None:
                return "/".join([volume, *parts[taken:]])
        raise NoVolume(path)

    def has_folder(self, path: str) -> bool:
        """Whether the folder exists: a volume, or one that was made or holds a file."""
        holds = any(each.startswith(path + "/") for each in (*self.files, *self.folders))
        return path in _VOLUMES.values() or path in self.folders or holds

    def listing(self, folder: str) -> list[Item] | None:
        """Entries of a folder; None when it does not exist."""
        if not self.has_folder(folder):
            return None
        every = {path[len(folder) + 1 :] for path in (*self.files, *self.folders) if path.startswith(folder + "/")}
        files = sorted(name for name in every if f"{folder}/{name}" in self.files and "/" not in name)
        folders = sorted({name.partition("/")[0] for name in every}.difference(files))
        size = {name: str(len(self.files[f"{folder}/{name}"])) for name in files}
        return [
            *(Item("fs-dir", name, {}) for name in folders),
            *(Item("fs-file", name, {"fs-size": size[name], "fs-readonly": "false"}) for name in files),
        ]
