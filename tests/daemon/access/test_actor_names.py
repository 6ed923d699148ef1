"""Names of keys: nobody can be taken for somebody else in the audit log."""

from pathlib import Path

import pytest

from daemon.access.actor_names import AUTO_POLICY, DAEMON, DRIFT_SCHEDULE, LOCAL_CLIENT, PLC_CLIENT, validate_key_name
from daemon.access.roles import Role
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.cell_under_test import Bench, serving, settings_for

ACTORS = (DAEMON, DRIFT_SCHEDULE, AUTO_POLICY, LOCAL_CLIENT, f"{PLC_CLIENT} 192.0.2.9")

IMITATIONS = [
    *ACTORS,
    *(actor.upper() for actor in ACTORS),
    "Po1icy_AUT0",
    "polіcy auto",  # Cyrillic і
    "policy\u00a0auto",
    "policy\u200bauto",
    "policy \u202eotua",
    "ｐｏｌｉｃｙ auto",
    "pölicy auto",
    "policy–auto",
    "𝐥𝐨𝐜𝐚𝐥",
    "ǀocal",
    "|ocal",
    " local",
    "local ",
    "local\n",
    "local\x9b2J",
    "ΗΑΝDΕΥΕD",  # Greek capitals
    "the  drift schedule",
    "",
    "...",
    "x" * 101,
    "127.0.0.1",
    "１２７.0.0.1",
    "192.0.2.9:502",
    "::1",
    "[fe80::1%eth0]",
    "0x7f.1",
    "1a2b3c4d",
    f"hek_1a2b3c4d_{'0' * 64}",
]


@pytest.mark.parametrize("name", IMITATIONS)
def test_a_name_that_looks_like_another_actors_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="; choose another"):
        validate_key_name(name)


@pytest.mark.parametrize(
    "name", ["Ann", "MES", "Jürgen Müller", "Łukasz", "Søren", "Gärtner & Söhne, cell 7", "ann@plant.example", "4711"]
)
def test_names_of_people_and_machines_are_taken(name: str) -> None:
    assert validate_key_name(name) == name


async def test_the_set_up_and_an_application_refuse_them_too(bench: Bench) -> None:
    code = bench.application.key_service.code.text
    for name in ("local", "127.0.0.1", "policy\u00a0auto"):
        refused = await bench.client.post("/setup", json={"code": code, "name": name})
        assert (refused.status_code, refused.json()["code"]) == (422, "document-refused")
    refused = await bench.client.post("/calibrations/x/apply", json={"applied_by": "Policy Auto"})
    assert (refused.status_code, refused.json()["code"]) == (422, "document-refused")


async def test_a_name_given_anew_does_not_get_the_old_holders_answers(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        desk, scans = bench.application.key_service, []
        for _ in range(2):
            key, _record = await desk.add("Ann", Role.OPERATOR, TEST)
            for _ in range(2):
                answer = await bench.client.post("/scans", headers={**bearer(key), "idempotency-key": "k"})
                scans.append(answer.json()["id"])
            await desk.revoke("Ann", TEST)
    assert scans[0] == scans[1] != scans[2] == scans[3]
