"""Scans opened over REST, and what lies in their folders."""

from pathlib import Path
from typing import Any

from tests.daemon.cell_under_test import Bench


async def a_scan(bench: Bench, **body: Any) -> dict[str, Any]:
    answer = await bench.client.post("/scans", json={"name": "door", **body})
    assert answer.status_code == 201, answer.text
    scan: dict[str, Any] = answer.json()
    assert answer.headers["location"] == scan["links"]["self"]
    return scan


def names(folder: Path) -> list[str]:
    return [file.name for file in folder.iterdir()]
