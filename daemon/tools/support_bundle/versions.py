"""The machine and the installed versions."""

import os
import platform
import shutil
from importlib import metadata
from pathlib import Path
from typing import Any

from daemon.runtime.version import SOFTWARE


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


def about_software() -> dict[str, Any]:
    """The daemon's version, Python's, and the installed packages with their licences, sorted by name."""
    packages = [
        {"name": found.name, "version": found.version, "licence": _licence(found)}
        for found in sorted(metadata.distributions(), key=lambda found: found.name.lower())
    ]
    return {"software": SOFTWARE, "licence": "Apache-2.0", "python": platform.python_version(), "packages": packages}


def _licence(found: metadata.Distribution) -> str:
    """The SPDX expression of a package, else the first line of its licence field; empty when it states none."""
    named = [found.metadata[field] for field in ("License-Expression", "License") if field in found.metadata]
    return str(named[0]).strip().partition("\n")[0][:100] if named else ""


def _first_lines(file: Path, count: int) -> list[str]:
    try:
        return file.read_text().splitlines()[:count]
    except OSError:
        return []
