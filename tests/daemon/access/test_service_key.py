"""Before the first key only root and the service's group move the arm of a service; afterwards they still need none."""

import json
from pathlib import Path

import pytest

from daemon.access.service_key import AUTHORIZATION, ServiceKey, read_authorization
from daemon.cli.rest_client import DEFAULT_URL, RunningService, connect, running_service
from daemon.runtime.systemd import Systemd
from tests.daemon.cell_under_test import serving, settings_for


def test_the_key_is_for_the_group_and_another_at_each_start(tmp_path: Path) -> None:
    first = ServiceKey.make(tmp_path)
    given = read_authorization(tmp_path)
    assert given is not None
    scheme, _, key = given.partition(" ")
    assert scheme == "Bearer"
    assert first.opens(key)
    assert (tmp_path / AUTHORIZATION).stat().st_mode & 0o777 == 0o640
    assert not ServiceKey.make(tmp_path).opens(key)
    assert [file.name for file in tmp_path.iterdir()] == [AUTHORIZATION]


def service(folder: Path) -> Systemd:
    (folder / "run").mkdir()
    return Systemd(f"{folder}/nobody", None, runtime_folder=folder / "run")


async def test_only_the_service_s_group_moves_the_arm_before_the_first_key(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path / "store"), systemd=service(tmp_path)) as bench:
        group = {"Authorization": str(read_authorization(tmp_path / "run"))}
        assert (await bench.client.get("/ready")).status_code == 200  # whoever is on this machine may look
        assert (await bench.client.get("/session")).json()["asked"] == "setup-code"
        for path in ("/calibrate", "/robot/jog", "/keys"):
            refused = await bench.client.post(path, json={"name": "Ann", "role": "admin"})
            assert (refused.status_code, refused.json()["code"]) == (403, "role-too-low"), path
            assert "-H @/run/handeyed/authorization" in refused.json()["fix"]
        run = (await bench.client.post("/calibrate", headers=group)).json()
        assert run["started_by"] == "the service's group"
        aborted = await bench.client.post(f"/runs/{run['id']}/abort")  # stopping the arm is for everybody here
        assert aborted.status_code in (200, 409), aborted.text
        made = await bench.client.post("/keys", headers=group, json={"name": "Ann", "role": "operator"})
        assert made.status_code == 201, made.text
        assert (await bench.client.get("/ready")).status_code == 401
        assert (await bench.client.get("/ready", headers=group)).status_code == 200
        assert (await bench.client.get("/ready", headers={"Authorization": "Bearer hek_0_0"})).status_code == 401


async def test_a_daemon_that_is_no_service_asks_nobody_before_the_first_key(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path / "store")) as bench:
        assert (await bench.client.post("/calibrate")).status_code == 202


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("daemon.cli.rest_client.running_service", lambda: running_service(tmp_path))
    monkeypatch.delenv("HANDEYED_KEY", raising=False)
    monkeypatch.delenv("HANDEYED_CA", raising=False)
    (tmp_path / "daemon.json").write_text(json.dumps({"url": "http://0.0.0.0:9000", "pid": 1}))
    (tmp_path / AUTHORIZATION).write_text("Authorization: Bearer hek_1_2\n")
    return tmp_path


@pytest.mark.parametrize(
    ("url", "known"),
    [
        (DEFAULT_URL, True),  # wherever the service listens
        ("http://localhost:9000", True),
        ("http://127.0.0.1:9000/", True),
        ("http://127.0.0.1:9001", False),  # somebody else's port
        ("http://cell-7.plant.example:9000", False),
    ],
)
def test_commands_give_the_key_to_the_service_and_to_nobody_else(runtime: Path, url: str, known: bool) -> None:
    with connect(url) as daemon:
        assert ("authorization" in daemon._http.headers) == known
        assert url != DEFAULT_URL or daemon.url == "http://127.0.0.1:9000"


def test_a_service_that_does_not_run_or_is_not_for_us_is_none(tmp_path: Path) -> None:
    assert running_service(tmp_path) is None
    (tmp_path / "daemon.json").write_text("[]")
    assert running_service(tmp_path) is None
    (tmp_path / "daemon.json").write_text('{"url": "https://[::]:1", "certificate": "/a"}')
    assert running_service(tmp_path) == RunningService("https://[::1]:1", Path("/a"), None)
