"""A set-up and a removal that are cut off after any of their requests: begun again, they end as if nothing had been."""

import ssl
from collections.abc import Callable, Iterable
from itertools import count
from pathlib import Path
from typing import Any

import httpx
import pytest

from drivers.robots.abb.rws import administration
from drivers.robots.abb.rws.client import RwsClient
from mock_robot.cell import MockCell
from mock_robot.rws.memory import Symbol
from mock_robot.rws.sessions import IDLE_S
from mock_robot.rws.world import World
from mock_robot.truth.truth import CellTruth
from tests.daemon.cli.running import Ran, handeyed
from tests.support.cases import seeds

THEIRS = {"HOME/handeyed/CELL_comm.mod": b"MODULE of_before\r\nENDMODULE\r\n", "HOME/theirs.mod": b"MODULE theirs\r\n"}
SYMBOL = "T_ROB1/CELL_shared/cell_reach"
SETUP = ("--set", "cell_reach=555", "--set", "cell_address=192.168.125.1")


class CutOff(httpx.AsyncBaseTransport):
    """A line to one controller that breaks after so many requests: the last of them is done, its answer is lost."""

    def __init__(self, application: Any, left: Callable[[], int]) -> None:
        self._line, self._left = httpx.ASGITransport(application), left

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        left = self._left()
        if left < 0:
            raise httpx.ConnectError("cut off")
        answer = await self._line.handle_async_request(request)
        if left == 0:
            raise httpx.ReadError("cut off")
        return answer


class ACabinet:
    """A bare controller, without sockets, behind a line that can be cut after `cut_after` requests."""

    def __init__(self, version: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        ticks, names = count(0.0, 0.1), count(1)
        self.pause_s = 0.0
        cell = MockCell(CellTruth.from_seed(7), clock=lambda: next(ticks) + self.pause_s)
        self.world: World = cell.rws.world
        service = cell.rws.first if version == 1 else cell.rws.second
        self.world.remove_robot_program()
        self.world.memory.symbols[SYMBOL] = Symbol("num", "400")
        self.world.volumes.files.update(THEIRS)
        self.folder, self.asked, self.cut_after = folder, 0, 10**6

        def left() -> int:
            self.asked += 1
            return self.cut_after - self.asked

        def session(client: RwsClient, asked: int) -> httpx.AsyncClient:
            secret = (client.address.user, client.address.password)
            return httpx.AsyncClient(
                transport=CutOff(service, left),
                base_url="http://127.0.0.1",
                auth=httpx.DigestAuth(*secret) if version == 1 else httpx.BasicAuth(*secret),
                verify=ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT),
            )

        monkeypatch.setattr(RwsClient, "_session", session)
        monkeypatch.setattr("drivers.robots.abb.rws.client.REQUESTS_PER_S", 1e9)
        monkeypatch.setattr(administration, "BACKUP_POLL_S", 1e-3)
        monkeypatch.setattr("daemon.cli.robot_setup._backup_name", lambda name: f"backup-{next(names)}")
        self._address = f"rws://127.0.0.1?version={version}"

    def run(self, command: str, *options: str, cut_after: int = 10**6) -> Ran:
        """Run the command in a session of its own, long after that of the one before."""
        self.asked, self.cut_after, self.pause_s = 0, cut_after, self.pause_s + 2 * IDLE_S
        return handeyed("robot", command, self._address, "--yes", "--backup", self.folder, *options)

    def state(self) -> Any:
        """What a set-up changes."""
        files = {path: text for path, text in self.world.volumes.files.items() if path.startswith("HOME/")}
        configuration = {
            (domain, kind, title): each.attributes
            for domain, kinds in self.world.equipment.configuration.items()
            for kind, instances in kinds.items()
            for title, each in instances.items()
        }
        folders = {folder for folder in self.world.volumes.folders if folder.startswith("HOME/")}
        return files, configuration, self.world.memory.symbols[SYMBOL].value, folders


def cuts(asked: int, version: int) -> Iterable[int]:
    """After which requests the line breaks: each by night, else every third, another one by each version of RWS."""
    return (version + seed for seed in seeds(asked + 1 - version))


@pytest.mark.slow
@pytest.mark.parametrize("version", [1, 2])
def test_a_set_up_that_is_cut_off_is_begun_again(version: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = ACabinet(version, tmp_path / "whole", monkeypatch)
    before = whole.state()
    assert whole.run("setup", *SETUP).status == 0
    asked, done = whole.asked, whole.state()
    assert done != before
    for cut in cuts(asked, version):
        cabinet = ACabinet(version, tmp_path / str(cut), monkeypatch)
        said = cabinet.run("setup", *SETUP, cut_after=cut).out.partition("\nok ")[2]
        assert "FAIL" not in said or "by hand  " not in said, cut
        again = cabinet.run("setup", *SETUP)
        assert again.status == 0, (cut, again.out, again.err)
        assert cabinet.state() == done, cut
        removed = cabinet.run("remove")
        assert removed.status == 0, (cut, removed.out, removed.err)
        assert cabinet.state() == before, cut


@pytest.mark.slow
@pytest.mark.parametrize("version", [1, 2])
def test_a_removal_that_is_cut_off_is_begun_again(
    version: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = ACabinet(version, tmp_path / "whole", monkeypatch)
    before = whole.state()
    assert whole.run("setup", *SETUP).status == 0
    assert whole.run("remove").status == 0
    for cut in cuts(whole.asked, version):
        cabinet = ACabinet(version, tmp_path / str(cut), monkeypatch)
        assert cabinet.run("setup", *SETUP).status == 0
        said = cabinet.run("remove", cut_after=cut).out
        assert "FAIL" not in said or "by hand  " not in said, cut
        again = cabinet.run("remove")
        assert again.status == 0, (cut, again.out, again.err)
        assert cabinet.state() == before, cut
