"""Builds the wheel with every room below the package `handeyed`, so that no module's name can clash with a plant's own.

In the repository the rooms are top-level packages (docs/decisions/0040). For the wheel their files are copied below
`handeyed/`, and `from calibration...` becomes `from handeyed.calibration...`. Nothing else of a file is changed.
"""

import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PACKAGE = "handeyed"
LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc")


class RoomsBelowPackage(BuildHookInterface):  # type: ignore[misc]
    """`rooms` of its configuration are moved below PACKAGE; `data` maps a folder, or files, to a folder there."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the moved tree to a standard wheel; an editable one uses the repository as it is."""
        if version == "editable":
            return
        root, rooms = Path(self.root), list(self.config["rooms"])
        self._tree = Path(tempfile.mkdtemp(prefix="handeyed-wheel-"))
        package = self._tree / PACKAGE
        shutil.copytree(root / PACKAGE, package, ignore=LEFT_OUT)
        for room in rooms:
            shutil.copytree(root / room, package / room, ignore=LEFT_OUT)
        for source, place in self.config.get("data", {}).items():
            for found in sorted(root.glob(source)):
                if found.is_dir():
                    shutil.copytree(found, package / place, ignore=LEFT_OUT, dirs_exist_ok=True)
                else:
                    (package / place).mkdir(parents=True, exist_ok=True)
                    shutil.copy(found, package / place)
        for file in sorted(package.rglob("*.py")):
            file.write_text(below_package(file.read_text(encoding="utf-8"), rooms, str(file)), encoding="utf-8")
        build_data["force_include"][str(package)] = PACKAGE

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the moved tree."""
        if version != "editable":
            shutil.rmtree(self._tree)


def below_package(text: str, rooms: list[str], name: str) -> str:
    """A module's text with its imports of `rooms` below PACKAGE. Raises ValueError for `import room`."""
    names = "|".join(rooms)
    if re.search(rf"^\s*import (?:{names})\b", text, re.MULTILINE):
        raise ValueError(f"{name}: write 'from room import ...', which the wheel's build can move")
    return re.sub(rf"^(\s*from )((?:{names})(?:\.\w+)* import\b)", rf"\1{PACKAGE}.\2", text, flags=re.MULTILINE)
