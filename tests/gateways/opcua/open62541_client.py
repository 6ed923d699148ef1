"""A client of another stack, open62541, by the package o6. Works a cell, and prints what it was told, as JSON.

Arguments: endpoint, folder with its certificate o6.der and key, key of an operator. o6 numbers namespaces by itself
and writes that number into structures (2.2.0), so that they are given to it, and read, as bytes.
"""

import asyncio
import json
import struct
import sys
from pathlib import Path
from typing import Any

import o6
from o6.ns import machine_vision

ENDPOINT, FOLDER, KEY = sys.argv[1], Path(sys.argv[2]), sys.argv[3]
AUTOMATIC = "cell7.VisionStateMachine.AutomaticModeStateMachine"
FIELDS = ("ResultState", "MeasId", "JobId", "ResultContent")
MEAS_ID, PART_ID, RECIPE_ID, PRODUCT_ID = 5006, 5013, 5002, 5224
RESULT_ID = 5274
"""Numbers of the structures' binary encodings in the nodeset of OPC 40100-1."""


def a_client(name: str, key: str) -> Any:
    """Encrypted and signed, with a certificate of its own; trusts the gateway's alone."""
    return o6.Client(
        ENDPOINT,
        name=name,
        certificate=FOLDER / "o6.der",
        privateKey=FOLDER / "o6-key.pem",
        trustList=[FOLDER / "own.der"],
        securityMode=o6.SecurityMode.SIGN_AND_ENCRYPT,
        securityPolicy=o6.SecurityPolicy.BASIC256SHA256,
        applicationUri="urn:test:client",
        username="mes",
        password=key,
    )


def node(name: str) -> str:
    """Of the namespace urn:handeyed:cells, as o6 calls it."""
    return f"ns=mes_cells;s={name}"


def structure(encoding: int, text: str, optional: bool = True) -> Any:
    """One whose only field with a value is its Id; `optional`: it has others, which are left out."""
    mask = struct.pack("<I", 0) if optional else b""
    body = mask + struct.pack("<i", len(text)) + text.encode()
    return o6.ExtensionObject(o6.NodeId(f"ns=machine_vision;i={encoding}"), o6.ByteString(body))


def text_of(found: Any, optional: bool = True) -> str:
    """The Id of such a structure."""
    return bytes(found.body)[8 if optional else 4 :].decode()


class Mes:
    """What it does, and what it has heard."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self.events: list[dict[str, Any]] = []
        self.ready: bool = False
        self.news = asyncio.Event()

    async def listen(self) -> None:
        paths = ", ".join(f"/{machine_vision.index}:{name}" for name in FIELDS)
        chosen = o6.ns.ns0.datatypes.EventFilter.parse(f"SELECT /EventType, /Message, {paths}")
        await self.client.monitorEvent(node("cell7"), self.hear_event, filter=chosen)
        await self.client.monitor(node("cell7.Cell.Ready"), self.hear_ready)

    def hear_event(self, event: dict[str, Any]) -> None:
        self.events.append({path.rpartition(":")[2].strip("/"): value for path, value in event.items()})
        self.news.set()

    def hear_ready(self, value: Any) -> None:
        self.ready = bool(value)
        self.news.set()

    async def until_ready(self) -> None:
        while not self.ready:
            self.news.clear()
            await self.news.wait()

    async def result_of(self, run_id: str) -> dict[str, Any]:
        """The event of its result."""
        while True:
            for event in self.events:
                if event["ResultState"] is not None and text_of(event["JobId"], optional=False) == run_id:
                    return event
            self.news.clear()
            await self.news.wait()

    async def call(self, name: str, *arguments: Any) -> tuple[str, list[Any]]:
        """The status's name, and the outputs."""
        status, *outputs = await self.client.call(node(name.rpartition(".")[0]), node(name), list(arguments))
        return status.name, outputs

    async def start_job(self, meas_id: str) -> tuple[str, list[Any]]:
        named = [structure(MEAS_ID, meas_id), structure(PART_ID, "part 1")]
        named += [structure(RECIPE_ID, "calibrate"), structure(PRODUCT_ID, "")]
        return await self.call(f"{AUTOMATIC}.StartSingleJob", *named, None)

    async def work(self) -> dict[str, Any]:
        """A job that is aborted while the arm is held, and one that ends."""
        await self.listen()
        await self.until_ready()
        told: dict[str, Any] = {}
        status, [job_id, _] = await self.start_job("order-1")
        first = text_of(job_id, optional=False)
        again, [job_id, _] = await self.start_job("order-1")
        told["started"] = [status, again, first, text_of(job_id, optional=False)]
        told["other"] = (await self.call("cell7.Cell.Start", "verify", "order-2"))[0]
        told["aborted"] = (await self.call("cell7.Cell.Abort"))[0]
        event = await self.result_of(first)
        told["firstResult"] = [int(event["ResultState"]), text_of(event["MeasId"])]
        await self.until_ready()
        _, [second] = await self.call("cell7.Cell.Start", "calibrate", "order-3")
        event = await self.result_of(second)
        told["second"] = [second, int(event["ResultState"]), text_of(event["MeasId"])]
        told["content"] = json.loads(event["ResultContent"][0])["state"]
        by_id = structure(RESULT_ID, second, optional=False)
        told["byId"] = (await self.call("cell7.ResultManagement.GetResultById", by_id, o6.Int32(0)))[0]
        told["reset"] = (await self.call("cell7.VisionStateMachine.Reset", o6.Int32(0), ""))[0]
        values = await self.client.read([node(f"cell7.Cell.{name}") for name in ("LastRunId", "Stations", "U_Mm")])
        told["types"] = [type(value).__name__ for value in values]
        told["flat"] = len(await self.client.browse(node("cell7.Cell")))
        told["written"] = (await self.client.write(node("cell7.Cell.Ready"), True)).name
        told["messages"] = [event["Message"].text for event in self.events]
        return told


async def main() -> None:
    """Work, then try a key that is none."""
    async with a_client("mes", KEY) as client:
        told = await Mes(client).work()
    try:
        async with a_client("stranger", "hek_wrong") as client:
            await client.read("i=2258")
        told["wrongKey"] = "read"
    except o6.StatusCodeError as error:
        told["wrongKey"] = str(error)
    print(json.dumps(told))


asyncio.run(main())
