"""Any bytes on any connection: no answer is an error of the daemon's, and it answers afterwards."""

import asyncio
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from daemon.access.roles import Role
from tests.daemon.access_keys import TEST
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.http.http_fuzz import Answers, Target, send_streams
from tests.daemon.http.tls_files import certificate, trusting
from tests.support.cases import cases
from tests.support.waiting import eventually


@pytest.mark.slow
@pytest.mark.usefixtures("heap_of_a_new_process")
@pytest.mark.parametrize("secured", [False, True], ids=["plain", "tls"])
async def test_random_and_damaged_streams(tmp_path: Path, secured: bool) -> None:
    server = certificate(tmp_path / "tls") if secured else {}
    async with serving(settings_for(tmp_path / "store", server=server)) as bench:
        key, _ = await bench.application.key_service.add("viewer", Role.VIEWER, TEST)
        target = Target(urlsplit(bench.url).port or 0, key, trusting(tmp_path / "tls") if secured else None)
        answers = Answers()
        await asyncio.to_thread(asyncio.run, send_streams([target], range(cases(300)), 1, answers))
        await eventually(lambda: not bench.server.server_state.connections and not bench.server.server_state.tasks)
    assert answers.failures == {}
    assert {200, 400, 401, 404} <= set(answers.by_status)
