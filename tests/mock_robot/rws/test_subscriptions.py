"""Subscriptions as the controllers have them: made by a POST, told over a WebSocket, lost at a restart."""

import asyncio
import re
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import httpx
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from mock_robot.cabinet.panel import Mode
from tests.mock_robot.rws_cell import ACCEPT_2, FORM_2, RwsCell, rws_cell
from tests.support.waiting import LIMIT_S

WORDS = {1: "robapi2_subscription", 2: "rws_subscription"}
STATE = {1: "/rw/panel/ctrlstate", 2: "/rw/panel/ctrl-state"}


@asynccontextmanager
async def client_of(cell: RwsCell, version: int) -> AsyncIterator[httpx.AsyncClient]:
    auth: httpx.Auth = httpx.BasicAuth("Admin", "robotics")
    if version == 1:
        auth = httpx.DigestAuth("Default User", "robotics")
    url = cell.first if version == 1 else cell.second
    headers = FORM_2 if version == 2 else {}
    async with httpx.AsyncClient(
        base_url=url, auth=auth, verify=False, headers=headers, trust_env=False, timeout=LIMIT_S
    ) as client:
        yield client


async def subscribed(client: httpx.AsyncClient, *resources: str, priority: int = 1) -> str:
    """The path of the socket of a subscription to these."""
    form: dict[str, str | list[str]] = {"resources": [str(number) for number in range(1, len(resources) + 1)]}
    for number, resource in enumerate(resources, 1):
        form |= {str(number): resource, f"{number}-p": str(priority)}
    answer = await client.post("/subscription?json=1", data=form)
    assert answer.status_code == 201, answer.text
    assert re.search(r'<a href="wss?://[^"]+/poll/\d+" rel="self"></a>', answer.text)
    assert "ABBCX" in answer.headers["set-cookie"]
    return "/" + answer.headers["location"].split("/", 3)[3]


def socket(client: httpx.AsyncClient, path: str, version: int, word: str | None = None) -> connect:
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    tls.check_hostname, tls.verify_mode = False, ssl.CERT_NONE
    cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    return connect(
        str(client.base_url).rstrip("/").replace("http", "ws", 1) + path,
        subprotocols=[word or WORDS[version]],  # type: ignore[list-item]
        additional_headers={"Cookie": cookies},
        ssl=tls if version == 2 else None,
        ping_interval=None,
        proxy=None,
    )


async def heard(connection: ClientConnection) -> str:
    return str(await asyncio.wait_for(connection.recv(), LIMIT_S))


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("facet", ["", ";ctrlstate"])
async def test_a_change_is_reported_once_and_what_was_there_before_is_not(version: int, facet: str) -> None:
    async with rws_cell() as cell, client_of(cell, version) as client:
        path = await subscribed(client, STATE[version] + facet, "/rw/panel/opmode")
        async with socket(client, path, version) as connection:
            cell.controller.switch_motors(False, cell.cell.clock())
            message = await heard(connection)
            assert f'<li class="pnl-ctrlstate-ev" title="ctrlstate"><a href="{STATE[version]}" rel="self"/>' in message
            assert '<span class="ctrlstate">motoroff</span>' in message
            cell.controller.switch_mode(Mode.MANR, cell.cell.clock())
            assert '<span class="opmode">MANR</span>' in await heard(connection)


async def test_every_line_of_the_event_log_is_reported_oldest_first() -> None:
    async with rws_cell() as cell, client_of(cell, 1) as client:
        async with socket(client, await subscribed(client, "/rw/elog/0"), 1) as connection:
            for code in (50050, 50080):
                cell.controller.record(cell.cell.clock(), code, "refused")
            first, second = await heard(connection), await heard(connection)
        assert '<span class="seqnum">2</span>' in first
        assert '<a href="/rw/elog/0/3" rel="self"/>' in second


async def test_whatever_is_sent_on_the_socket_of_2_closes_it_with_1008_and_that_of_1_does_not_mind() -> None:
    async with rws_cell() as cell, client_of(cell, 2) as second, client_of(cell, 1) as first:
        async with socket(second, await subscribed(second, STATE[2]), 2) as connection:
            await connection.send("PING")
            with pytest.raises(ConnectionClosed) as closed:
                await heard(connection)
            assert closed.value.rcvd is not None
            assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, "Client cannot send data.")
        async with socket(first, await subscribed(first, STATE[1]), 1) as connection:
            await connection.send("PING")
            cell.controller.switch_motors(False, cell.cell.clock())
            assert "motoroff" in await heard(connection)


async def test_pings_are_with_answers_of_1_alone() -> None:
    async with rws_cell() as cell, client_of(cell, 1) as first, client_of(cell, 2) as second:
        async with socket(first, await subscribed(first, STATE[1]), 1) as connection:
            await asyncio.wait_for(await connection.ping(), LIMIT_S)
        async with socket(second, await subscribed(second, STATE[2]), 2) as connection:
            pong = await connection.ping()
            cell.controller.switch_motors(False, cell.cell.clock())
            assert "motoroff" in await heard(connection)
            assert not pong.done()
            pong.cancel()


@pytest.mark.parametrize("version", [1, 2])
async def test_a_socket_needs_the_right_word_the_cookie_and_opens_once(version: int) -> None:
    async with rws_cell() as cell, client_of(cell, version) as client, client_of(cell, version) as stranger:
        path = await subscribed(client, STATE[version])

        async def refused(who: httpx.AsyncClient, word: str | None = None) -> int:
            with pytest.raises(InvalidStatus) as answer:
                async with socket(who, path, version, word):
                    pass
            return answer.value.response.status_code

        assert await refused(client, WORDS[3 - version]) == 400
        assert await refused(stranger) == {1: 403, 2: 401}[version]
        async with socket(client, path, version):
            assert await refused(client) == 404
        assert await refused(client) == 404


@pytest.mark.parametrize(
    ("form", "why"),
    [
        ({}, "nothing"),
        ({"resources": "1", "1": "/rw/nothing", "1-p": "1"}, "no such resource"),
        ({"resources": "1", "1": "/rw/panel/opmode", "1-p": "2"}, "high priority is for signals and persistents"),
        ({"resources": "1", "1": "/rw/panel/opmode"}, "no priority"),
    ],
)
async def test_a_subscription_that_makes_no_sense_is_refused(form: dict[str, str], why: str) -> None:
    async with rws_cell() as cell, client_of(cell, 2) as client:
        answer = await client.post("/subscription", data=form)
        assert (answer.status_code, answer.json()["status"]["code"]) == (400, -1073445879), why


async def test_a_restart_loses_sessions_subscriptions_and_mastership() -> None:
    async with rws_cell() as cell, client_of(cell, 2) as client:
        await client.post("/rw/mastership/request")
        path = await subscribed(client, STATE[2])
        async with socket(client, path, 2) as connection:
            cell.cell.inject_fault("link-restart")
            with pytest.raises(ConnectionClosed):
                await heard(connection)
        assert cell.cell.rws.second.sessions.count == 0
        assert cell.world.mastership.holder("rapid") is None
        old = client.cookies["ABBCX"]
        assert (await client.get("/rw/panel/opmode", headers=ACCEPT_2)).status_code == 200
        assert client.cookies["ABBCX"] != old


async def test_a_group_is_deleted_by_its_own_path() -> None:
    async with rws_cell() as cell, client_of(cell, 2) as client:
        path = await subscribed(client, STATE[2])
        assert (await client.delete(path)).status_code == 404
        assert (await client.delete(path.replace("poll", "subscription"))).status_code == 204
        assert cell.cell.rws.second.subscriptions.groups == {}
