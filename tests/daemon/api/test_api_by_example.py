"""docs/api.md and docs/use/mes.md run as they stand."""

import asyncio
import re
from pathlib import Path
from typing import Any

from daemon.webhooks.dispatcher import signature_headers
from tests.daemon.cell_under_test import serving, settings_for

DOCS = Path(__file__).parents[3] / "docs"


def run_the_page(page: Path, url: str) -> dict[str, Any]:
    """Every block of Python, one after the other, as a reader would paste them."""
    names: dict[str, Any] = {"URL": url}
    for block in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL):
        exec(compile(block, str(page), "exec"), names)
    return names


async def test_the_pages_examples_run(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        names = await asyncio.to_thread(run_the_page, DOCS / "api.md", bench.url)
    names["daemon"].close()
    assert [run["kind"] for run in names["runs"]] == ["jog", "verify", "verify", "calibration"]
    secret, body = b"s" * 32, b'{"id": "m"}'
    headers = signature_headers("m", int(names["time"].time()), body, [b"other" * 8, secret])
    assert names["verified"](headers, body, secret)
    assert not names["verified"](headers, body + b" ", secret)


async def test_the_lines_for_a_mes_run(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        names = await asyncio.to_thread(run_the_page, DOCS / "use" / "mes.md", bench.url)
        current = (await bench.client.get("/calibrations/current")).json()
    assert (current["calibration"]["id"], current["applied"]["applied_by"]) == (names["made"].id, "MES")
    assert names["points_base"].shape == (2, 3)
    assert names["event"]["event"] == "calibration"
