"""A small round of Schemathesis: all checks, stateful. Large: python -m benchmarks.daemon.schemathesis --cases 20000"""

import asyncio
import copy
import json
from pathlib import Path

import pytest

from daemon.access.roles import Role
from daemon.store.actor import AuditContext
from tests.daemon.api import schemathesis_round
from tests.daemon.api.schemathesis_round import end_streams_soon, one_round
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import serving, settings_for

pytestmark = pytest.mark.slow

PHASES = "examples,fuzzing,stateful"


async def test_no_request_that_openapi_allows_or_forbids_is_answered_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(settings_for(tmp_path / "store", calibration={"manual_wait_s": 1})) as bench:
        await apply_calibration(bench)
        end_streams_soon(bench.application.events)
        key, _ = await bench.application.key_service.add("schemathesis", Role.ADMIN, AuditContext())
        headers = {"Authorization": f"Bearer {key}"}  # so spelt, the check of ignored keys finds it
        cases, passed, text = await asyncio.to_thread(one_round, bench.url, headers, 1, 1, tmp_path, PHASES)
        assert passed, text
        assert cases > 40
        document = copy.deepcopy(json.loads(schemathesis_round.OPENAPI.read_text()))
        document["components"]["schemas"]["HealthDocument"]["properties"]["uptime_s"] = {"type": "string"}
        (tmp_path / "wrong.json").write_text(json.dumps(document))
        monkeypatch.setattr(schemathesis_round, "OPENAPI", tmp_path / "wrong.json")
        _, passed, text = await asyncio.to_thread(
            one_round, bench.url, headers, 1, 1, tmp_path, "fuzzing", ("--include-path", "/health")
        )
        assert not passed
        assert "GET /health" in text


async def test_the_same_over_the_cookie_of_a_session(tmp_path: Path) -> None:
    """All but what ends it: /session and /keys. That nothing is answered without it: test_access.py."""
    async with serving(settings_for(tmp_path / "store", calibration={"manual_wait_s": 1})) as bench:
        await apply_calibration(bench)
        end_streams_soon(bench.application.events)
        key, _ = await bench.application.key_service.add("schemathesis", Role.ADMIN, AuditContext())
        token, _, _ = await bench.application.sign_in.with_key(key, "test", "test")
        headers = {"Cookie": f"handeyed={token}", "Origin": bench.url}
        others = ("--exclude-path-regex", "^/(session|setup|keys)", "--exclude-checks", "ignored_auth")
        cases, passed, text = await asyncio.to_thread(
            one_round, bench.url, headers, 1, 2, tmp_path, "examples,fuzzing", others
        )
        assert passed, text
        assert cases > 40
        assert (await bench.client.get("/audit", headers=headers)).status_code == 200
