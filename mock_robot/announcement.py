"""The line of JSON with which a mock cell says that it is ready, and where."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mock_robot.rws.station import RwsUrls


@dataclass(frozen=True)
class Announcement:
    """Every address, and the cell's sheet: what an integrator knows. Nothing of the truth."""

    seed: int
    robot_host: str
    robot_port: int | None
    serial_path: str | None
    devices_url: str | None
    control_url: str
    sheet: dict[str, Any]
    rws: RwsUrls | None = None

    def document(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "schema_version": 1,
            "seed": self.seed,
            "pid": os.getpid(),
            "robot": {"host": self.robot_host, "port": self.robot_port, "serial": self.serial_path},
            "camera": self._device("camera/snapshot.png"),
            "scanner": self._device("scanner/cloud.ply"),
            "rws": None if self.rws is None else {"1.0": self.rws.first, "2.0": self.rws.second},
            "control": self.control_url,
            "cell": self.sheet,
        }

    def _device(self, path: str) -> str | None:
        return None if self.devices_url is None else f"{self.devices_url}/{path}"

    def line(self) -> str:
        """One line."""
        return json.dumps(self.document())

    def write(self, path: Path) -> None:
        """Into a file that is there whole or not at all."""
        unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        unfinished.write_text(self.line() + "\n")
        unfinished.replace(path)
