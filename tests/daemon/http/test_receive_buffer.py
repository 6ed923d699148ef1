"""One room for the bytes of all connections: clouds that come in at the same time do not mix."""

import asyncio
import ssl
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np
import pytest
import uvloop

from calibration.transforms import Array
from daemon.access.roles import Role
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.clouds import OCTETS, POSE, cloud, in_base
from tests.daemon.http.tls_files import certificate, trusting
from tests.support.waiting import LIMIT_S

CLOUDS, POINTS = 3, 300_000


@pytest.mark.parametrize("loops", [asyncio.new_event_loop, uvloop.new_event_loop], ids=["asyncio", "uvloop"])
@pytest.mark.parametrize("secured", [False, True], ids=["plain", "tls"])
def test_clouds_at_the_same_time(tmp_path: Path, loops: Callable[[], asyncio.AbstractEventLoop], secured: bool) -> None:
    async def moved(url: str, verify: ssl.SSLContext | bool, key: str, number: int) -> Array:
        content = cloud(POINTS, seed=number).astype("<f4").tobytes()
        async with httpx.AsyncClient(base_url=url, verify=verify, timeout=LIMIT_S, headers=bearer(key)) as client:
            answer = await client.post("/register", params={"pose": POSE}, content=content, headers=OCTETS)
        assert answer.status_code == 200, answer.text
        return np.frombuffer(answer.content, "<f4").reshape(-1, 3)

    async def all_of_them() -> list[Array]:
        server = certificate(tmp_path / "tls") if secured else {}
        async with serving(settings_for(tmp_path / "store", server=server)) as bench:
            await apply_calibration(bench)
            key, _ = await bench.application.key_service.add("scanner", Role.OPERATOR, TEST)
            verify = trusting(tmp_path / "tls") if secured else False
            url = bench.url.replace("127.0.0.1", "localhost")
            return await asyncio.gather(*(moved(url, verify, key, number) for number in range(CLOUDS)))

    with asyncio.Runner(loop_factory=loops) as runner:
        for number, answer in enumerate(runner.run(all_of_them())):
            np.testing.assert_allclose(answer, in_base(cloud(POINTS, seed=number)), atol=2e-3)
