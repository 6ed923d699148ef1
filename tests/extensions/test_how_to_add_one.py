"""docs/how-to/add-an-extension.md: what it shows is an extension that the daemon serves."""

import re
from pathlib import Path
from typing import Any

from daemon.api.app import routes
from extensions.installed import INSTALLED
from tests.daemon.cell_under_test import serving, settings_for

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-an-extension.md"


async def test_the_extension_of_the_page_answers_its_route(tmp_path: Path) -> None:
    shown: dict[str, Any] = {"__name__": "the_page"}
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(code, str(PAGE), "exec"), shown)
    extensions = (*INSTALLED, shown["DISK"])

    async with serving(settings_for(tmp_path), extensions=extensions) as bench:
        answer = await bench.client.get("/disk")
        links = (await bench.client.get("/")).json()["links"]

    assert answer.status_code == 200, answer.text
    assert answer.json()["free_bytes"] > 0
    assert links["disk"] == "/disk"
    assert routes(None, extensions).openapi()["paths"]["/disk"]["get"]["operationId"] == "get_disk"
