"""docs/api.md runs as it stands."""

import asyncio
import re
from pathlib import Path
from typing import Any

from daemon.webhooks.signing import signature_headers
from tests.daemon.cell_under_test import serving, settings_for

PAGE = Path(__file__).parents[3] / "docs" / "api.md"


def run_the_page(url: str) -> dict[str, Any]:
    """Every block of Python, one after the other, as a reader would paste them."""
    names: dict[str, Any] = {"URL": url}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL):
        exec(compile(block, str(PAGE), "exec"), names)
    names["daemon"].close()
    return names


async def test_the_pages_examples_run(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        names = await asyncio.to_thread(run_the_page, bench.url)
    assert [run["kind"] for run in names["runs"]] == ["jog", "verify", "verify", "calibration"]
    secret, body = b"s" * 32, b'{"id": "m"}'
    headers = signature_headers("m", int(names["time"].time()), body, [b"other" * 8, secret])
    assert names["verified"](headers, body, secret)
    assert not names["verified"](headers, body + b" ", secret)
