"""Over OPC UA the mock's arm moves for an operator's key and a new ticket only, whatever is ended and cut meanwhile.

Cell, daemon and gateway over real sockets; the truth is the mock's own count of the moves that it accepted.
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest

pytest.importorskip("asyncua", reason="asyncua is not here: pip install 'handeyed[opcua]'")

from asyncua import ua

from daemon.access.roles import Role
from daemon.cell.devices import open_devices
from daemon.composition import build
from tests.daemon.access_keys import TEST, bearer
from tests.gateways.opcua.plant import PlantClient, plant, refused
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.stories.plant import poses_taught_for, settings_of, small_pictures
from tests.support.ports import free_port
from tests.support.serving import serve_for_tests
from tests.support.waiting import LIMIT_S, eventually

SEED = 7
COMPLETED, ABORTED = 1, 3


@pytest.mark.slow
@pytest.mark.timeout(1200)
async def test_no_result_is_lost_or_doubled_and_no_ticket_moves_the_arm_twice(tmp_path: Path) -> None:
    async with running_cell(SEED, 100.0, truth=small_pictures(SEED)) as cell, a_site(cell, tmp_path) as site:
        there = {"cell7": f"http://127.0.0.1:{site.line.port}"}, {"cell7": site.keys["viewer"]}
        async with plant(tmp_path, *there) as gateway, gateway.client("mes", site.keys["operator"]) as mes:
            async with gateway.client("panel", site.keys["viewer"]) as panel:
                await at_the_cell(mes)
                assert await refused(panel.call("cell7.Cell.Start", "calibrate", "first")) == "BadUserAccessDenied"
            assert await refused(mes.call("cell7.Cell.Start", "calibrate", "")) == "BadInvalidArgument"
            assert cell.commanded_moves == 0, "neither a viewer nor a start without a ticket"
            await result_of(mes, await site.begin(mes, "first"), COMPLETED)
            await site.stands_for_known_tickets(mes)
            gateway_ends = await site.begin(mes, "while-the-gateway-restarts")
        await site.run_over(gateway_ends)

        async with plant(tmp_path, *there) as gateway, gateway.client("mes", site.keys["operator"]) as mes:
            await at_the_cell(mes)
            await mes.waits("cell7.Cell.LastRunId", gateway_ends)
            await site.stands_for_known_tickets(mes)

            network_ends = await site.begin(mes, "while-the-network-is-cut")
            await site.line.cut()
            await mes.waits("cell7.Cell.State", "Preoperational")
            await site.run_over(network_ends)
            await site.line.mend()
            await result_of(mes, network_ends, COMPLETED)
            await site.stands_for_known_tickets(mes)

            daemon_ends = await site.begin(mes, "while-the-daemon-restarts")
            await site.daemon.aclose()
            moves = cell.commanded_moves
            await mes.waits("cell7.Cell.State", "Preoperational")
            await site.start_daemon()
            await result_of(mes, daemon_ends, ABORTED)
            await site.stands_for_known_tickets(mes)
            assert cell.commanded_moves == moves, "a daemon that starts"

            heard = [event.JobId.Id for event in mes.events if is_result(event)]
            assert heard == [network_ends, daemon_ends], "since this gateway began, each once"
            assert await listed(mes) == list(reversed(site.started.values())), "all, each once"


@dataclass
class Line:
    """A network between gateway and daemon, which can be cut."""

    to: int
    port: int = field(default_factory=free_port)
    _server: asyncio.Server | None = None
    _ends: set[asyncio.StreamWriter] = field(default_factory=set)

    async def mend(self) -> None:
        self._server = await asyncio.start_server(self._carry, "127.0.0.1", self.port)

    async def cut(self) -> None:
        if self._server is not None:
            self._server.close()
        for end in self._ends:
            end.transport.abort()

    async def _carry(self, near: asyncio.StreamReader, back: asyncio.StreamWriter) -> None:
        try:
            far, on = await asyncio.open_connection("127.0.0.1", self.to)
        except OSError:
            back.close()
            return
        self._ends |= {back, on}
        await asyncio.gather(_copy(near, on), _copy(far, back))


async def _copy(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while content := await source.read(65536):
            sink.write(content)
            await sink.drain()
    sink.close()


@dataclass
class Site:
    """A cell and its daemon, which keeps folder and port. `started`: the run that each ticket began."""

    cell: RunningCell
    folder: Path
    port: int
    line: Line
    daemon: AsyncExitStack
    keys: dict[str, str] = field(default_factory=dict)
    started: dict[str, str] = field(default_factory=dict)

    async def start_daemon(self) -> None:
        changes = {"server": {"port": self.port}, "calibration": {"poses": poses_taught_for(SEED)}}
        application = build(settings_of(self.cell.announcement, self.folder, **changes), open_devices)
        await self.daemon.enter_async_context(serve_for_tests(application))
        if not self.keys:
            for role in (Role.VIEWER, Role.OPERATOR):
                self.keys[role.word] = (await application.key_service.add(role.word, role, TEST))[0]

    async def begin(self, mes: PlantClient, ticket: str) -> str:
        """A new run, for which the arm moves."""
        await mes.waits("cell7.Cell.Ready", True)
        moves = self.cell.commanded_moves
        run_id = str(await mes.call("cell7.Cell.Start", "calibrate", ticket))
        assert run_id not in self.started.values()
        self.started[ticket] = run_id
        await eventually(lambda: self.cell.commanded_moves > moves)
        return run_id

    async def stands_for_known_tickets(self, mes: PlantClient) -> None:
        """Each ticket answers the run that it began, and no arm moves for it."""
        await mes.waits("cell7.Cell.Ready", True)
        moves = self.cell.commanded_moves
        for ticket, run_id in self.started.items():
            assert await mes.call("cell7.Cell.Start", "calibrate", ticket) == run_id
        assert await mes.read("cell7.Cell.Ready") is True
        assert self.cell.commanded_moves == moves

    async def run_over(self, run_id: str) -> None:
        headers, url = bearer(self.keys["viewer"]), f"http://127.0.0.1:{self.port}/runs/{run_id}"
        async with httpx.AsyncClient(timeout=2 * LIMIT_S) as client:
            answer = await client.get(url, params={"wait": LIMIT_S}, headers=headers)
        assert answer.json()["over"]


@asynccontextmanager
async def a_site(cell: RunningCell, folder: Path) -> AsyncIterator[Site]:
    """The daemon up, the network whole."""
    async with AsyncExitStack() as daemon:
        port = free_port()
        site = Site(cell, folder, port, Line(port), daemon)
        await site.start_daemon()
        await site.line.mend()
        try:
            yield site
        finally:
            await site.line.cut()


async def at_the_cell(mes: PlantClient) -> None:
    await mes.listen(*(f"cell7.Cell.{name}" for name in ("Ready", "State", "LastRunId")), events_of="cell7")


def is_result(event: Any) -> bool:
    return getattr(event, "ResultState", None) is not None


async def result_of(mes: PlantClient, run_id: str, state: int) -> None:
    """Its event has come."""
    event = await mes.hears(ResultId=ua.ResultIdDataType(Id=run_id))
    assert event.ResultState == state


async def listed(mes: PlantClient) -> list[str]:
    """The ids that GetResultListFiltered answers, the newest first."""
    kind = ua.VariantType
    unset = ua.Variant(None, kind.Null)
    filters = [ua.Variant(0, kind.Int32), *[unset] * 8, ua.Variant(0, kind.UInt32), ua.Variant(0, kind.UInt32)]
    _, _, _, found, _ = await mes.call("cell7.ResultManagement.GetResultListFiltered", *filters)
    return [result.ResultId.Id for result in found]
