"""Keys that end within 30 days are warned of, unless their successor is there."""

from pathlib import Path

import pytest

from daemon.access.keys import KeyRecord
from daemon.access.roles import Role
from daemon.store.actor import AuditContext
from daemon.store.monitor import ending
from tests.daemon.cell_under_test import serving, settings_for

NOW = "2026-11-26T08:00:00.000Z"


def key(key_id: str, name: str, expires_at: str | None, revoked_at: str | None = None) -> KeyRecord:
    return KeyRecord(key_id, name, "operator", "", "2026-01-01T00:00:00.000Z", expires_at, revoked_at)


@pytest.mark.parametrize(
    ("records", "expected"),
    [
        ([key("1", "MES", "2026-12-01T00:00:00.000Z")], ["1"]),
        ([key("1", "MES", None)], []),
        ([key("1", "MES", "2026-11-01T00:00:00.000Z")], []),  # it has ended: requests say so
        ([key("1", "MES", "2026-12-01T00:00:00.000Z", revoked_at=NOW)], []),
        ([key("1", "MES", "2026-11-27T00:00:00.000Z"), key("2", "MES", "2027-11-26T00:00:00.000Z")], ["2"]),  # rotated
        ([key("1", "MES", "2026-12-01T00:00:00.000Z"), key("2", "Ann", "2026-12-02T00:00:00.000Z")], ["1", "2"]),
    ],
)
def test_which_keys_end(records: list[KeyRecord], expected: list[str]) -> None:
    assert [record.id for record in ending(records, NOW)] == expected


async def test_ready_and_metrics_have_a_key_that_ends_soon(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        service, who = bench.application.key_service, AuditContext()
        secret, record = await service.add("MES", Role.VIEWER, who, days=29)
        await service.add("Ann", Role.ADMIN, who, days=31)
        expiry = next(one for one in bench.application.services if type(one).__name__ == "KeyExpiry")
        await expiry.look()  # type: ignore[attr-defined] # it looks each minute
        asked = {"Authorization": f"Bearer {secret}"}
        ready = (await bench.client.get("/ready", headers=asked)).json()
        (warning,) = ready["warnings"]
        assert warning.startswith(f"the key MES ends on {str(record.expires_at)[:10]}, in 28 days")
        text = (await bench.client.get("/metrics", headers=asked)).text
        assert 'handeyed_key_expires_timestamp_seconds{name="MES"}' in text
        assert 'handeyed_key_expires_timestamp_seconds{name="Ann"}' in text
