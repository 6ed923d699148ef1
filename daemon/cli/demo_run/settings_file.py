"""handeyed.toml for the mock cell, from its data sheet, as an integrator would write it; without the truth."""

from typing import Any

from daemon.config.toml_text import toml_text

TOLERANCE_MM = 1.0
"""Largest U (k = 2) of a measured point in the demo's cell."""


def settings_text(announcement: dict[str, Any], port: int) -> str:
    """The settings of a daemon at `port` for the mock cell with this ready file."""
    robot, cell = announcement["robot"], announcement["cell"]
    sections: dict[str, dict[str, Any]] = {
        "robot": {
            "address": f"tcp://{robot['host']}:{robot['port']}",
            "limit_s": 20.0,  # the mock controller is one of many programs on this PC
            "model": cell["arm"],
            "speed_mm_s": 250.0,
            "box_mm": cell["box_mm"],
        },
        "camera": {
            "address": announcement["camera"],
            "setup": cell["setup"],
            "limit_s": 60.0,  # its pictures are rendered beside everything else on this PC
            "intrinsics": cell["camera"],
        },
        "scanner": {"address": announcement["scanner"], "unit": "mm", "poses": cell["scan_poses"]},
        "target": cell["target"],
        "calibration": {
            "policy": "auto",
            "tolerance_mm": TOLERANCE_MM,
            **{name: guess for name, guess in cell.items() if name.endswith("_guess")},
        },
        "server": {"port": port},
        "storage": {"folder": "store", "reserve_mb": 50.0},
        "report": {"cell": "Mock cell"},
    }
    return toml_text(sections)
