"""The controller's disk: HOME, TEMP and the RAM disk, kept in memory, under every name clients have for them."""

from dataclasses import dataclass, field

from mock_robot.rws.exchange import Item

RAMDISK_PATH = "/bd0/ramdisk"
_VOLUMES = {"home": "HOME", "temp": "TEMP", "ramdisk": "RAMDISK", "bd0/ramdisk": "RAMDISK"}


class NoVolume(Exception):
    """The first part of the path is none of the volumes."""


@dataclass
class Volumes:
    """Files by canonical path: `HOME/handeyed/CELL_shared.sys`."""

    files: dict[str, bytes] = field(default_factory=dict)

    def canonical(self, path: str) -> str:
        """`$HOME/x`, `HOME:/x`, `HOME/x` and `/bd0/ramdisk/x` as keys. Raises NoVolume."""
        parts = [part for part in path.replace("\\", "/").split("/") if part]
        for taken in (1, 2):
            volume = _VOLUMES.get("/".join(parts[:taken]).strip("$:").lower())
            if volume is not None:
                return "/".join([volume, *parts[taken:]])
        raise NoVolume(path)

    def listing(self, folder: str) -> list[Item] | None:
        """What lies in a folder; None when there is no such folder."""
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
