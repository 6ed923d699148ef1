"""Mock cells and daemons of a plant, each in a process of its own, with its gateway and its Prometheus."""

import asyncio
import os
import sys
import time
from asyncio.subprocess import DEVNULL, Process
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import httpx
import yaml

from daemon.cli.demo_run.scenario import settings_text
from mock_robot.truth.truth import CellTruth
from tests.gateways.opcua.plant import Plant
from tests.mock_robot.running_cell import ROOT, CellProcess, cell_process
from tests.support.ports import free_port
from tests.support.waiting import LIMIT_S

TIME_SCALE = 40
STARTING = 3
"""Processes that start at a time: the machine has few cores."""

POLL_S = 0.2
FRAGMENT = '[report]\nplant = "Plant 3"\ncell = "{name}"\n'
PROMETHEUS = ROOT / "deploy" / "prometheus"

ItemT = TypeVar("ItemT")


async def for_each(items: Iterable[ItemT], act: Callable[[ItemT], Awaitable[None]], at_a_time: int = STARTING) -> None:
    """Await `act` of each, so many at a time; the first error ends the others."""
    places = asyncio.Semaphore(at_a_time)

    async def one(item: ItemT) -> None:
        async with places:
            await act(item)

    async with asyncio.TaskGroup() as group:
        for item in items:
            group.create_task(one(item))


async def until(holds: Callable[[], Awaitable[bool]], what: str) -> None:
    """Ask until it holds; fails when it never does."""
    end_s = time.monotonic() + LIMIT_S
    while not await holds():
        assert time.monotonic() < end_s, f"never: {what}"
        await asyncio.sleep(POLL_S)


@dataclass
class FleetCell:
    """A mock cell, and the daemon that works for it. The daemon keeps folder and port when it is started again."""

    name: str
    seed: int
    folder: Path
    mock: CellProcess
    port: int
    daemon: Process | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def truth(self) -> CellTruth:
        return CellTruth.from_seed(self.seed)

    async def start(self, release: Path) -> None:
        """Start the daemon of this release, and wait until it answers."""
        with (self.folder / "daemon.log").open("ab") as log:
            self.daemon = await _run("serve", str(self.folder / "handeyed.toml"), log=log, release=release)
        await until(self.answers, f"{self.name} answers; see {self.folder}/daemon.log")

    async def answers(self) -> bool:
        assert self.daemon is not None
        assert self.daemon.returncode is None, f"it ended; see {self.folder}/daemon.log"
        try:
            await self.get("/health")
        except httpx.TransportError:
            return False
        return True

    async def update(self, release: Path) -> None:
        """As the package does: stop in order, start the other release."""
        assert self.daemon is not None
        self.daemon.terminate()
        assert await self.daemon.wait() == 0
        await self.start(release)

    async def kill(self) -> None:
        """SIGKILL."""
        if self.daemon is not None and self.daemon.returncode is None:
            self.daemon.kill()
            await self.daemon.wait()

    async def get(self, path: str, **parameters: Any) -> Any:
        async with httpx.AsyncClient(base_url=self.url, timeout=LIMIT_S) as client:
            answer = await client.get(path, params=parameters)
        answer.raise_for_status()
        return answer.json()

    async def run_over(self, run_id: str) -> dict[str, Any]:
        """The run when it has ended."""
        run: dict[str, Any] = {"over": False}
        while not run["over"]:
            run = await self.get(f"/runs/{run_id}", wait=30)
        return run


@asynccontextmanager
async def fleet_of(count: int, folder: Path, release: Path) -> AsyncIterator[list[FleetCell]]:
    """So many cells, whose daemons answer."""
    cells: list[FleetCell] = []
    async with AsyncExitStack() as held:

        async def begin(number: int) -> None:
            at = folder / f"press-{number}"
            (at / "conf.d").mkdir(parents=True)
            arguments = ("--seed", str(number), "--time-scale", str(TIME_SCALE), "--controller", "python")
            mock = await held.enter_async_context(cell_process(*arguments))
            cell = FleetCell(at.name, number, at, mock, free_port())
            held.push_async_callback(cell.kill)
            (at / "handeyed.toml").write_text(settings_text(mock.announcement, cell.port))
            (at / "conf.d" / "10-plant.toml").write_text(FRAGMENT.format(name=cell.name))
            await cell.start(release)
            cells.append(cell)

        await for_each(range(1, count + 1), begin)
        yield sorted(cells, key=lambda cell: cell.seed)


def a_release(folder: Path, version: str) -> Path:
    """A folder for PYTHONPATH with which this code says that it is another release: its metadata come first."""
    metadata = folder / version / f"handeyed-{version}.dist-info" / "METADATA"
    metadata.parent.mkdir(parents=True)
    metadata.write_text(f"Metadata-Version: 2.1\nName: handeyed\nVersion: {version}\n")
    return folder / version


@asynccontextmanager
async def gateway_of(cells: list[FleetCell], folder: Path) -> AsyncIterator[Plant]:
    """`handeyed opcua` over all of them."""
    port = free_port()
    endpoint = f"opc.tcp://127.0.0.1:{port}/"
    _write_gateway(cells, folder, endpoint)
    with (folder / "gateway.log").open("wb") as log:
        process = await _run("opcua", str(folder / "gateway.toml"), log=log)

    async def listens() -> bool:
        assert process.returncode is None, (folder / "gateway.log").read_text()
        try:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            return False
        writer.close()
        return True

    try:
        await until(listens, f"the gateway listens; see {folder}/gateway.log")
        yield Plant(folder, endpoint)
    finally:
        process.terminate()
        await process.wait()


def _write_gateway(cells: list[FleetCell], folder: Path, endpoint: str) -> None:
    (folder / "trusted").mkdir(parents=True)
    tables = [f'[[cell]]\nname = "{cell.name}"\nurl = "{cell.url}"\n' for cell in cells]
    server = f'[server]\nendpoint = "{endpoint}"\ncertificate = "own.der"\nprivate_key = "own-key.pem"\n'
    (folder / "gateway.toml").write_text("".join(tables) + server + 'trusted = "trusted"\n')


@dataclass(frozen=True)
class Prometheus:
    """A running server, asked as a dashboard asks it."""

    url: str

    async def ask(self, query: str) -> list[dict[str, Any]]:
        """The labels of each row, with its `value`."""
        async with httpx.AsyncClient(base_url=self.url, timeout=LIMIT_S) as client:
            try:
                answer = (await client.get("/api/v1/query", params={"query": query})).json()
            except httpx.TransportError:
                return []
        rows = answer.get("data", {}).get("result", [])
        return [{**row["metric"], "value": float(row["value"][1])} for row in rows]

    async def by_cell(self, query: str, label: str = "value") -> dict[str, Any]:
        """One column of the fleet's table: a label, or the value, by the cell's name."""
        return {row["cell"]: row[label] for row in await self.ask(query)}


@asynccontextmanager
async def prometheus_of(cells: list[FleetCell], folder: Path) -> AsyncIterator[Prometheus]:
    """Prometheus with the example of deploy/prometheus: a job and a file of targets for each cell, and our rules."""
    example = yaml.safe_load((PROMETHEUS / "fleet.yml").read_text(encoding="utf-8"))
    (folder / "cells").mkdir(parents=True)
    jobs = []
    for cell in cells:
        [group] = yaml.safe_load((PROMETHEUS / "cells" / "press-1.yml").read_text(encoding="utf-8"))
        group = {"targets": [f"127.0.0.1:{cell.port}"], "labels": {**group["labels"], "cell": cell.name}}
        (folder / "cells" / f"{cell.name}.yml").write_text(yaml.safe_dump([group]))
        job = {**example["scrape_configs"][0], "job_name": cell.name, "scheme": "http"}
        del job["authorization"], job["tls_config"]  # on this machine without key and authority
        jobs.append({**job, "file_sd_configs": [{"files": [f"cells/{cell.name}.yml"]}]})
    example["global"] = dict.fromkeys(("scrape_interval", "evaluation_interval"), "1s")
    example |= {"rule_files": [str(PROMETHEUS / "handeyed.rules.yml")], "scrape_configs": jobs}
    (folder / "prometheus.yml").write_text(yaml.safe_dump(example))
    address = f"127.0.0.1:{free_port()}"
    process = await asyncio.create_subprocess_exec(
        "prometheus", f"--config.file={folder}/prometheus.yml", f"--storage.tsdb.path={folder}/data",
        f"--web.listen-address={address}", stdout=DEVNULL, stderr=DEVNULL,
    )  # fmt: skip
    try:
        yield Prometheus(f"http://{address}")
    finally:
        process.kill()
        await process.wait()


async def _run(*arguments: str, log: Any, release: Path | None = None) -> Process:
    environment = {**os.environ, **({} if release is None else {"PYTHONPATH": str(release)})}
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", "daemon.cli", *arguments, stdout=log, stderr=log, cwd=ROOT, env=environment
    )
