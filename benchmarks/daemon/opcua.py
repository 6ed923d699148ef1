"""`python -m benchmarks.daemon.opcua [--cells 50] [--items 1000] [--seconds 15] [--hours 1|--clients 5000]`: its cost.

The gateway in a process of its own over daemons that only talk (one process, /live five times a second under load),
and a client with monitored items over SignAndEncrypt. Reported: time until clients can read, processor time at rest
and under load, memory, the delay of a result's event, an abort over OPC UA beside the same over REST, the memory after
100 connections that send half a message and wait, and after 30 clients that came and left; and how long a cell is Ready
whose daemon hangs (SIGSTOP), and one whose daemon is killed. With `--hours` instead: its memory while clients come and
leave for so long, one a second: half in order, a quarter cut off, a quarter refused.
With `--clients` the same of so many, each as soon as the one before has left. The gateway has its unit's variables.
"""

import argparse
import asyncio
import gc
import itertools
import json
import logging
import multiprocessing
import os
import shutil
import signal
import socket
import struct
import tempfile
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from gateways.opcua.cell_state import SCALARS
from gateways.opcua.gateway import MAX_SESSION_MS
from gateways.opcua.settings import CellSettings, GatewaySettings, ServerSettings
from tests.gateways.opcua.plant import Plant, PlantClient, refused, unit_environment
from tests.support.ports import free_port

READY = {"calibrate": {"ready": True, "reasons": []}, "warnings": [], "warning_details": []}
BUSY_BEAT_S, REST_BEAT_S, HEARTBEAT_S = 0.2, 1.0, 15.0
HALF_MESSAGES = 100
CHUNK_BYTES = 60_000


def talk(port: int) -> None:
    """Serve /CELL/live and the rest of what the gateway asks of each daemon; POST /busy and /result change what."""
    busy, ended = [False], asyncio.Event()
    number = [0]

    async def live(_: Request) -> Response:
        async def beats() -> AsyncIterator[bytes]:
            count = 0
            robot = {"mode": "automatic"}
            yield _event("live", {"ready": READY, "run": None, "robot": robot, "devices": [], "software": "talker"})
            while True:
                count += 1
                run = {"id": "r", "kind": "verify", "station": count, "stations": count}
                moved = {"at": str(count), "run": run if busy[0] else None}
                yield _event("live", moved)
                await asyncio.sleep(BUSY_BEAT_S if busy[0] else REST_BEAT_S)

        return StreamingResponse(beats(), media_type="text/event-stream")

    async def events(_: Request) -> Response:
        async def ends() -> AsyncIterator[bytes]:
            while True:
                yield b": here\n\n"
                with suppress(TimeoutError):
                    await asyncio.wait_for(ended.wait(), HEARTBEAT_S)
                    yield _event("run", {"id": f"r{number[0]}", "state": "finished"}, number[0])

        return StreamingResponse(ends(), media_type="text/event-stream")

    async def run(request: Request) -> Response:
        return JSONResponse(_run(request.path_params["run"]))

    async def act(request: Request) -> Response:
        if request.path_params["what"] == "busy":
            busy[0] = not busy[0]
        else:
            number[0] += 1
            ended.set()
            ended.clear()
        return JSONResponse({})

    async def none(_: Request) -> Response:
        return JSONResponse({"code": "no-calibration", "detail": "", "fix": ""}, 404)

    async def of_ready(_: Request) -> Response:
        return JSONResponse(READY)

    async def of_drift(_: Request) -> Response:
        return JSONResponse({"standing": "steady", "points": []})

    async def session(_: Request) -> Response:
        return JSONResponse({"last_event_id": 0})

    async def runs(_: Request) -> Response:
        return JSONResponse({"runs": [_run("r", over=False)], "next": None})

    async def metrics(_: Request) -> Response:
        return PlainTextResponse("handeyed_store_sound 1\n")

    routes = [
        Route("/act/{what}", act, methods=["POST"]),
        Route("/{cell}/live", live),
        Route("/{cell}/events", events),
        Route("/{cell}/runs", runs),
        Route("/{cell}/runs/{run}", run),
        Route("/{cell}/runs/{run}/abort", run, methods=["POST"]),
        Route("/{cell}/ready", of_ready),
        Route("/{cell}/session", session),
        Route("/{cell}/drift", of_drift),
        Route("/{cell}/metrics", metrics),
        Route("/{cell}/calibrations/current", none),
    ]
    uvicorn.run(Starlette(routes=routes), host="127.0.0.1", port=port, log_level="error")


def run_gateway(settings: GatewaySettings, alive: Any) -> None:
    """The gateway, until it is terminated. At SIGUSR1 `alive` gets how many sessions and subscriptions it holds."""
    from asyncua.server.internal_subscription import InternalSubscription

    from gateways.opcua.gateway import serve
    from gateways.opcua.sessions import KeySession

    for name in ("asyncua", "asyncuagds"):
        logging.getLogger(name).setLevel(logging.CRITICAL)

    def count() -> None:
        gc.collect()
        held = gc.get_objects()
        sessions = sum(isinstance(one, KeySession) and one.external for one in held)
        alive[:] = [sessions, sum(isinstance(one, InternalSubscription) for one in held)]

    async def forever() -> None:
        asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, count)
        async with serve(settings, alone=True):
            await asyncio.Event().wait()

    asyncio.run(forever())


@asynccontextmanager
async def running(cells: int) -> AsyncIterator[tuple[Plant, str, psutil.Process, psutil.Process, Any]]:
    """A gateway over so many talkers: where clients connect, the talkers' address and process, its own, its `alive`."""
    spawning = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory(prefix="handeyed-opcua-") as name:
        folder, port, web = Path(name), free_port(), free_port()
        endpoint, url = f"opc.tcp://127.0.0.1:{port}/", f"http://127.0.0.1:{web}"
        server = ServerSettings(
            endpoint=endpoint,
            certificate=folder / "own.der",
            private_key=folder / "own-key.pem",
            trusted=folder / "trusted",
        )
        settings = GatewaySettings(
            cell=tuple(CellSettings(name=f"cell{k}", url=f"{url}/cell{k}") for k in range(cells)), server=server
        )
        alive = spawning.Array("i", [-1, -1])
        processes = [spawning.Process(target=talk, args=(web,), daemon=True)]
        processes[0].start()
        try:
            await _listens(web)
            processes.append(spawning.Process(target=run_gateway, args=(settings, alive), daemon=True))
            processes[1].start()
            await _listens(port)
            talker, gateway = (psutil.Process(process.pid) for process in processes)
            yield Plant(folder, endpoint), url, talker, gateway, alive
        finally:
            for process in reversed(processes):
                process.kill()
                process.join()
            shutil.rmtree(folder, ignore_errors=True)


async def measure(cells: int, items: int, seconds: float) -> None:
    """Print each figure."""
    async with running(cells) as (plant, url, talker, gateway, _):
        async with plant.client() as client, httpx.AsyncClient(base_url=url) as rest:
            print(f"{cells} cells: ready after {time.time() - gateway.create_time():.1f} s, {_mb(gateway):.0f} MB")
            await _load(client, rest, gateway, cells, items, seconds)
            await _abort(client, rest)
            await _result(client, rest)
        await _half_messages(int(plant.endpoint.rstrip("/").rpartition(":")[2]), gateway)
        before_mb = _mb(gateway)
        for _ in range(30):
            async with plant.client() as client:
                await client.listen("cell0.Cell.Ready")
        print(f"30 clients that came and left: {before_mb:.0f} MB before, {_mb(gateway):.0f} MB after")
        async with plant.client() as client:
            await _away(client, talker)


async def come_and_leave(cells: int, hours: float, count: int) -> None:
    """Print how the gateway's memory changes while clients come and leave, one a second or so many."""
    ways = (_leave_in_order, _leave_in_order, _are_cut_off, _are_refused)
    async with running(cells) as (plant, _, _, gateway, alive):
        began_s, sampled = time.monotonic(), list[float]()
        for way in itertools.cycle(ways):
            next_s = time.monotonic() + (1.0 if hours else 0.0)
            await way(plant)
            sampled.append(_mb(gateway))
            if len(sampled) == count or (hours and time.monotonic() > began_s + 3600 * hours):
                break
            await asyncio.sleep(max(0.0, next_s - time.monotonic()))
        quarter = len(sampled) // 4
        first, last = (float(np.median(part)) for part in (sampled[:quarter], sampled[-quarter:]))
        slope = 1000 * np.polyfit(np.arange(quarter, len(sampled)), sampled[quarter:], 1)[0]
        took_h = (time.monotonic() - began_s) / 3600
        print(f"{len(sampled)} clients came and left in {took_h:.2f} h, a quarter of them cut off, a quarter refused: "
              f"{first:.1f} MB in the first quarter, {last:.1f} MB in the last (medians); "
              f"{slope:+.2f} MB by 1,000 clients after the first")  # fmt: skip
        tenths = " ".join(f"{np.median(part):.1f}" for part in np.array_split(sampled, 10))
        print(f"medians of each tenth: {tenths} MB")
        print(f"held at the end: {await _held(gateway, alive)} sessions and subscriptions")


async def _leave_in_order(plant: Plant) -> None:
    async with plant.client() as client:
        await client.listen("cell0.Cell.Ready", events_of="cell0")
        await client.read("cell0.Cell.State")


async def _are_cut_off(plant: Plant) -> None:
    """Their session is open, and has a subscription."""
    async with plant.client() as client:
        await client.listen("cell0.Cell.Ready", events_of="cell0")
        client.client.uaclient.request_disconnect()
        client.client.disconnect_socket()


async def _are_refused(plant: Plant) -> None:
    """Their certificate is none that the gateway trusts."""
    assert await refused(_sign_in(plant)) == "BadCertificateUntrusted"


async def _sign_in(plant: Plant) -> None:
    async with plant.client("stranger", trusted=False):
        pass


async def _held(gateway: psutil.Process, alive: Sequence[int]) -> list[int]:
    """How many are left when a client that was cut off can no longer return."""
    for _ in range(10):
        gateway.send_signal(signal.SIGUSR1)
        await asyncio.sleep(MAX_SESSION_MS / 5000)
        if list(alive) == [0, 0]:
            break
    return list(alive)


async def _load(
    client: PlantClient, rest: httpx.AsyncClient, gateway: psutil.Process, cells: int, items: int, seconds: float
) -> None:
    names = [f"cell{k}.Cell.{name}" for k in range(cells) for name in SCALARS][:items]
    await client.listen(*names)
    for what in ("at rest", "under load"):
        if what == "under load":
            await rest.post("/act/busy")
        count, cpu_s, at_s = client.changes, sum(gateway.cpu_times()[:2]), time.monotonic()
        await asyncio.sleep(seconds)
        used = (sum(gateway.cpu_times()[:2]) - cpu_s) / (time.monotonic() - at_s)
        changes = client.changes - count
        print(f"{len(names)} items {what}: {100 * used:.1f} % of a core, {changes} changes in {seconds:g} s, "
              f"{_mb(gateway):.0f} MB")  # fmt: skip
    await rest.post("/act/busy")


async def _abort(client: PlantClient, rest: httpx.AsyncClient) -> None:
    took: dict[str, list[float]] = {"OPC UA": [], "REST": []}
    for _ in range(20):
        began_s = time.perf_counter()
        await client.call("cell0.Cell.Abort")
        took["OPC UA"].append(time.perf_counter() - began_s)
        began_s = time.perf_counter()
        await rest.post("/cell0/runs/r/abort")
        took["REST"].append(time.perf_counter() - began_s)
    told = ", ".join(f"{1000 * np.median(each):.0f} ms ({1000 * max(each):.0f} at most)" for each in took.values())
    print(f"abort over OPC UA and over REST: {told}")


async def _result(client: PlantClient, rest: httpx.AsyncClient) -> None:
    await client.listen(events_of="cell0")
    delays = []
    for k in range(1, 6):
        began_s = time.perf_counter()
        await rest.post("/act/result")
        await client.hears(Message=f"r{k} finished")
        delays.append(time.perf_counter() - began_s)
    print(f"a result's event: {1000 * max(delays):.0f} ms at most after the daemon's")


async def _away(client: PlantClient, talker: psutil.Process) -> None:
    await client.listen("cell0.Cell.Ready")
    took_s = []
    for end in (talker.suspend, talker.kill):
        await client.waits("cell0.Cell.Ready", True)
        began_s = time.perf_counter()
        end()
        await client.waits("cell0.Cell.Ready", False)
        took_s.append(time.perf_counter() - began_s)
        if end == talker.suspend:
            talker.resume()
    print("not Ready after a daemon hangs: {:.1f} s; after one is killed: {:.1f} s".format(*took_s))


async def _half_messages(port: int, gateway: psutil.Process) -> None:
    """Connections that never finish their first message. Chunks of a message for an open channel that is not there."""
    before_mb, held = _mb(gateway), []
    for _ in range(HALF_MESSAGES):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        hello = struct.pack("<IIIII", 0, 65535, 65535, 0, 0) + struct.pack("<i", -1)
        writer.write(b"HELF" + struct.pack("<I", 8 + len(hello)) + hello)
        await writer.drain()
        await reader.read(28)
        held.append(writer)
    for number in range(1, 41):
        for writer in held:
            chunk = struct.pack("<IIII", 0, 0, number, 1) + bytes(CHUNK_BYTES)
            if writer.is_closing():
                continue
            try:
                writer.write(b"MSGC" + struct.pack("<I", 8 + len(chunk)) + chunk)
                await asyncio.wait_for(writer.drain(), 1.0)
            except (OSError, TimeoutError):
                continue
    await asyncio.sleep(2.0)
    print(f"{HALF_MESSAGES} connections with half a message: {_mb(gateway) - before_mb:+.0f} MB")
    for writer in held:
        writer.close()


async def _listens(port: int) -> None:
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        await asyncio.sleep(0.05)


def _event(kind: str, data: dict[str, Any], number: int | None = None) -> bytes:
    head = "" if number is None else f"id: {number}\n"
    return f"{head}event: {kind}\ndata: {json.dumps(data)}\n\n".encode()


def _run(run_id: str, over: bool = True) -> dict[str, Any]:
    at = "2026-01-01T00:00:00Z"
    return {"id": run_id, "kind": run_id, "state": "finished", "over": over, "updated_at": at, "result": {}}


def _mb(process: psutil.Process) -> float:
    return float(process.memory_info().rss / 1e6)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=50)
    parser.add_argument("--items", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--hours", type=float, default=0.0)
    parser.add_argument("--clients", type=int, default=0)
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.update(unit_environment())  # malloc reads its own when the gateway's process begins
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    lasting = options.hours or options.clients
    what = come_and_leave(options.cells, options.hours, options.clients) if lasting else None
    asyncio.run(what or measure(options.cells, options.items, options.seconds))


if __name__ == "__main__":
    main()
