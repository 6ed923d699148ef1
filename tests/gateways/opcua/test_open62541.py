"""The gateway as a client of another stack sees it: open62541, by PyPI's o6, in a virtual environment of its own."""

import asyncio
import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("asyncua", reason="asyncua is not here: pip install 'handeyed[opcua]'")

from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID

from gateways.opcua.cell_state import SCALARS
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Parts
from tests.extensions.plc.foreign_clients import output_of
from tests.gateways.opcua.plant import CLIENT, plant

PYTHON = Path(os.environ.get("HANDEYED_OPEN62541", ""), "python")


@pytest.mark.slow
@pytest.mark.skipif(not PYTHON.is_file(), reason="o6 is not here: pip install it, set HANDEYED_OPEN62541 to its bin")
async def test_open62541_starts_aborts_and_reads_without_our_stack(tmp_path: Path) -> None:
    parts = Parts()
    async with with_keys(tmp_path, parts) as (bench, keys):

        async def runs() -> list[dict[str, Any]]:
            answer = await bench.client.get("/runs", headers=bearer(keys["viewer"]))
            return list(answer.json()["runs"])

        async def held_until_an_abort(_: int, stops: int = parts.robot.stops) -> None:
            while parts.robot.stops == stops and not any(run["over"] for run in await runs()):  # noqa: ASYNC110 - behind HTTP
                await asyncio.sleep(0.01)

        parts.robot.before_move = held_until_an_abort
        async with plant(tmp_path, {"cell7": bench.url}, {"cell7": keys["viewer"]}) as gateway:
            await a_certificate(tmp_path)
            script = Path(__file__).with_name("open62541_client.py")
            out = await output_of(str(PYTHON), str(script), gateway.endpoint, str(tmp_path), keys["operator"])
        second, first = (run["id"] for run in await runs())
    told = json.loads(out[out.index("\n{") :].splitlines()[1])
    assert told["started"] == ["GOOD", "GOOD", first, first]
    assert (told["other"], told["aborted"], told["reset"]) == ("BAD_INVALID_STATE", "GOOD", "BAD_NOT_SUPPORTED")
    assert told["firstResult"] == [3, "order-1"]
    assert told["second"] == [second, 1, "order-3"]
    assert (told["content"], told["byId"]) == ("finished", "GOOD")
    assert told["flat"] == len(SCALARS) + len(("Start", "Abort"))
    assert told["types"] == ["str", "int32", "float64"]
    assert (told["written"], told["wrongKey"]) == ("BAD_USER_ACCESS_DENIED", "BAD_USER_ACCESS_DENIED")
    assert told["messages"].count("calibration began") == 2


async def a_certificate(folder: Path) -> None:
    """The client's, which the gateway trusts."""
    use = [ExtendedKeyUsageOID.CLIENT_AUTH]
    own = folder / "o6.der"
    await setup_self_signed_certificate(folder / "o6-key.pem", own, CLIENT, "localhost", use, {"commonName": "o6"})
    shutil.copy(own, folder / "trusted" / own.name)
