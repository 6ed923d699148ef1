"""The machine and the installed versions."""

import os
import platform
import shutil
from importlib import metadata
from pathlib import Path
from typing import Any


def describe_machine(store: Path) -> dict[str, Any]:
    """System, cores, load, memory, disk of the store, and the installed packages."""
    existing = next(place for place in (store, *store.parents) if place.exists())
    disk = shutil.disk_usage(existing)
    return {
        "system": platform.platform(),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": os.getloadavg(),
        "memory": _first_lines(Path("/proc/meminfo"), 3),
        "uptime_s": _first_lines(Path("/proc/uptime"), 1),
        "store": str(store),
        "disk_bytes": {"total": disk.total, "free": disk.free},
        "packages": {found.name: found.version for found in metadata.distributions()},
    }


def _first_lines(file: Path, count: int) -> list[str]:
    try:
        return file.read_text().splitlines()[:count]
    except OSError:
        return []
