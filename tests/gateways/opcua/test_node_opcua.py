"""The gateway as a client sees it that nobody here wrote: npm's node-opcua."""

import json
import os
import shutil
from pathlib import Path

import pytest

pytest.importorskip("asyncua", reason="asyncua is not here: pip install 'handeyed[opcua]'")

from tests.daemon.cell_under_test import serving, settings_for
from tests.extensions.plc.foreign_clients import output_of
from tests.gateways.opcua.plant import plant


@pytest.mark.slow
async def test_node_opcua_starts_a_job_once_and_is_told_its_result(tmp_path: Path) -> None:
    modules = os.environ.get("HANDEYED_NODE_MODULES", "")
    if shutil.which("node") is None or not (Path(modules) / "node-opcua-client").is_dir():
        pytest.skip("npm's node-opcua-client is not here: npm install node-opcua-client, set HANDEYED_NODE_MODULES")
    script = Path(__file__).with_name("node_opcua.js")
    async with serving(settings_for(tmp_path)) as bench, plant(tmp_path, {"cell7": bench.url}) as gateway:
        await bench.client.get("/ready")
        out = await output_of("node", str(script), gateway.endpoint, str(tmp_path), "any", NODE_PATH=modules)
        told = json.loads(out.splitlines()[-1])
        runs = (await bench.client.get("/runs")).json()["runs"]
    assert told["started"] == "Good"
    assert [run["id"] for run in runs] == [told["jobId"]] == [told["again"]] == [told["resultOf"]]
    assert (told["state"], told["measId"], told["result"]["state"]) == (1, "order-4711", "finished")
    assert (told["partId"], told["byId"]) == ("part 1", ["Good", 1, "part 1"])
    assert told["lastResult"] == "finished"
    assert told["active"] == "", "the settings leave that to a person"
    assert "calibration began" in told["events"]
    assert "calibration began" in told["atServer"]
    assert (told["refresh"], told["refreshed"]) == ("Good", [2787, 2788])
