"""The controller's disk as the file service lists it."""

from dataclasses import dataclass

from mock_robot.cabinet.disk import RAMDISK_PATH, Disk, NoVolume
from mock_robot.rws.exchange import Item

__all__ = ["RAMDISK_PATH", "NoVolume", "Volumes"]


@dataclass
class Volumes(Disk):
    """The disk, with listings of its folders."""

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
