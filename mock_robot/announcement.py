"""The JSON line a mock cell prints when it is ready: addresses and the cell's nominal data."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mock_robot.rws.station import RwsUrls


@dataclass(frozen=True)
class Announcement:
    """Addresses of all interfaces, and the cell sheet: what an integrator knows, nothing of the truth."""

    seed: int
    robot_host: str
    robot_port: int | None
    serial_path: str | None
    devices_url: str | None
    control_url: str
    sheet: dict[str, Any]
    rws: RwsUrls | None = None
    profiler: str | None = None
    cameras: tuple[str, ...] = ()
    scanners: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """The announcement as a JSON document."""
        return {
            "schema_version": 1,
            "seed": self.seed,
            "pid": os.getpid(),
            "robot": {"host": self.robot_host, "port": self.robot_port, "serial": self.serial_path},
            "camera": self._device("camera/snapshot.png"),
            "scanner": self._device("scanner/cloud.ply"),
            "cameras": {name: self._device(f"cameras/{name}/snapshot.png") for name in self.cameras},
            "scanners": {name: self._device(f"scanners/{name}/cloud.pcd") for name in self.scanners},
            "profiler": self.profiler,
            "rws": None if self.rws is None else {"1.0": self.rws.first, "2.0": self.rws.second},
            "control": self.control_url,
            "cell": self.sheet,
        }

    def _device(self, path: str) -> str | None:
        return None if self.devices_url is None else f"{self.devices_url}/{path}"

    def line(self) -> str:
        """The announcement as one line of JSON."""
        return json.dumps(self.document())

    def write(self, path: Path) -> None:
        """Write the line atomically: readers see the whole file or none."""
        unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        unfinished.write_text(self.line() + "\n")
        unfinished.replace(path)
