"""The controller's disk in memory: HOME, TEMP and the RAM disk, under all names clients use for them."""

from dataclasses import dataclass, field

from mock_robot.rws.exchange import Item

RAMDISK_PATH = "/bd0/ramdisk"
_VOLUMES = {"home": "HOME", "temp": "TEMP", "ramdisk": "RAMDISK", "bd0/ramdisk": "RAMDISK"}


class NoVolume(Exception):
    """The first part of the path is not a volume."""


@dataclass
class Volumes:
    """Files by canonical path such as `HOME/handeyed/CELL_shared.sys`."""

    files: dict[str, bytes] = field(default_factory=dict)

    def canonical(self, path: str) -> str:
        """Canonical key of `$HOME/x`, `HOME:/x`, `HOME/x` or `/bd0/ramdisk/x`. Raises NoVolume."""
        parts = [part for part in path.replace("\\", "/").split("/") if part]
        for taken in (1, 2):
            volume = _VOLUMES.get("/".join(parts[:taken]).strip("$:").lower())
            if volume is not None:
                return "/".join([volume, *parts[taken:]])
        raise NoVolume(path)

    def listing(self, folder: str) -> list[Item] | None:
        """Entries of a folder; None when it does not exist."""
        inside = [path[len(folder) + 1 :] for path in sorted(self.files) if path.startswith(folder + "/")]
        if not inside and folder not in _VOLUMES.values():
            return None
        folders = sorted({name.partition("/")[0] for name in inside if "/" in name})
        files = [name for name in inside if "/" not in name]
        size = {name: str(len(self.files[f"{folder}/{name}"])) for name in files}
        return [
            *(Item("fs-dir", name, {}) for name in folders),
            *(Item("fs-file", name, {"fs-size": size[name], "fs-readonly": "false"}) for name in files),
        ]
