"""A gateway over daemons with fake devices, and a client that it trusts."""

import asyncio
import shutil
from collections.abc import AsyncIterator, Awaitable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from asyncua import Client, Node, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from cryptography.x509.oid import ExtendedKeyUsageOID

from gateways.opcua.gateway import serve
from gateways.opcua.settings import CellSettings, GatewaySettings, ServerSettings
from gateways.opcua.vision_system import CELLS, MACHINE_VISION
from tests.support.ports import free_port
from tests.support.waiting import LIMIT_S

CLIENT = "urn:test:client"

UNIT = Path(__file__).resolve().parents[3] / "deploy" / "fleet" / "handeyed-opcua.service"


@dataclass
class Plant:
    """A running gateway. `folder` has its certificates, and those of the client."""

    folder: Path
    endpoint: str

    @asynccontextmanager
    async def client(
        self, label: str = "mes", key: str = "any", trusted: bool = True, session: Path | None = None
    ) -> AsyncIterator["PlantClient"]:
        """A signed-in client; `trusted`: its certificate lies in the gateway's folder.

        `session`: a file in which it keeps its session, to return to.
        """
        name = f"{label.replace('@', '-')}-{trusted}"
        certificate, private = self.folder / f"{name}.der", self.folder / f"{name}-key.pem"
        use = [ExtendedKeyUsageOID.CLIENT_AUTH]
        await setup_self_signed_certificate(private, certificate, CLIENT, "localhost", use, {"commonName": name})
        if trusted:
            shutil.copy(certificate, self.folder / "trusted" / certificate.name)
        # asyncua's client leaves by itself when a read takes longer than this: on a busy machine a second is nothing
        client = Client(self.endpoint, timeout=LIMIT_S, watchdog_intervall=LIMIT_S)
        client.application_uri, client.session_state_path = CLIENT, session
        gateway = self.folder / "own.der"
        await client.set_security(SecurityPolicyBasic256Sha256, certificate, private, server_certificate=gateway)
        client.set_user(label)
        client.set_password(key)
        async with client:
            yield PlantClient(client, await client.get_namespace_index(CELLS))


@dataclass
class PlantClient:
    """What a SCADA system does."""

    client: Client
    cells: int
    events: list[Any] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)
    changes: int = 0
    _news: asyncio.Event = field(default_factory=asyncio.Event)

    def node(self, name: str) -> Node:
        return self.client.get_node(ua.NodeId(name, self.cells))

    async def read(self, name: str) -> Any:
        return await self.node(name).read_value()

    async def call(self, name: str, *arguments: Any) -> Any:
        return await self.node(name.rpartition(".")[0]).call_method(self.node(name), *arguments)

    async def listen(self, *names: str, events_of: str = "", alarms: bool = False) -> None:
        """Be told of changes of variables, and of events of a cell.

        `alarms`: of conditions that came before as well; without a cell, of those of all, at the Server object.
        """
        subscription = await self.client.create_subscription(50, self)
        if names:
            await subscription.subscribe_data_change([self.node(name) for name in names])
        if events_of or alarms:
            types = await self.client.get_namespace_index(MACHINE_VISION)
            kinds = [ua.NodeId(number, types) for number in (1018, 1013, 1024, 1034, 1035)]
            await subscription.subscribe_events(self.node(events_of) if events_of else self.client.nodes.server, kinds)
        if alarms:
            conditions = self.client.get_node(ua.ObjectIds.ConditionType)
            asked_for = ua.Variant(subscription.subscription_id, ua.VariantType.UInt32)
            await conditions.call_method(ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh), asked_for)

    def datachange_notification(self, node: Node, value: Any, data: object) -> None:
        self.values[node.nodeid.Identifier] = value
        self.changes += 1
        self._news.set()

    def event_notification(self, event: Any) -> None:
        self.events.append(event)
        self._news.set()

    async def hears(self, **fields: Any) -> Any:
        """The first event of all that were told with these values; a text is looked for within."""
        async with asyncio.timeout(LIMIT_S):
            while True:
                for event in self.events:
                    if all(_has(getattr(event, name, None), value) for name, value in fields.items()):
                        return event
                self._news.clear()
                await self._news.wait()

    async def waits(self, name: str, value: Any) -> None:
        """Until a variable that is listened to has this value."""
        async with asyncio.timeout(LIMIT_S):
            while self.values.get(name) != value:
                self._news.clear()
                await self._news.wait()


def _has(found: Any, wanted: Any) -> bool:
    return wanted in found.Text if isinstance(found, ua.LocalizedText) else bool(found == wanted)


@asynccontextmanager
async def plant(folder: Path, urls: Mapping[str, str], keys: Mapping[str, str] | None = None) -> AsyncIterator[Plant]:
    """A gateway over the daemons at `urls`, by the cells' names; `keys`: of viewers."""
    cells = []
    for name, url in urls.items():
        file = folder / f"{name}.key"
        if keys:
            file.write_text(keys[name])
        cells.append(CellSettings(name=name, url=url, key_file=file if keys else None))
    server = ServerSettings(
        endpoint=f"opc.tcp://127.0.0.1:{free_port()}/",
        certificate=folder / "own.der",
        private_key=folder / "own-key.pem",
        trusted=folder / "trusted",
    )
    async with serve(GatewaySettings(cell=tuple(cells), server=server)) as endpoint:
        yield Plant(folder, endpoint)


def unit_environment() -> dict[str, str]:
    """The variables that the gateway's unit sets."""
    lines = (line.removeprefix("Environment=") for line in UNIT.read_text().splitlines() if line.startswith("Env"))
    return dict(pair.split("=", 1) for line in lines for pair in line.split())


async def refused(request: Awaitable[Any]) -> str:
    """The name of the status with which a request is refused."""
    try:
        await request
    except ua.UaError as error:
        return type(error).__name__
    return "accepted"
