"""One gateway over a daemon with fake devices, asked by a client of the OPC UA library it is not made with alone."""

import asyncio
import struct
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

pytest.importorskip("asyncua", reason="asyncua is not here: pip install 'handeyed[opcua]'")

from asyncua import Client, ua

from gateways.opcua.cell import Cell
from gateways.opcua.cell_state import CellState
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Parts, serving, settings_for
from tests.daemon.fakes import Gate
from tests.gateways.opcua.plant import plant, refused
from tests.support.ports import free_port
from tests.support.waiting import LIMIT_S

AUTOMATIC = "cell7.VisionStateMachine.AutomaticModeStateMachine"


@pytest.mark.slow
async def test_a_run_is_started_once_by_its_ticket_and_told_from_its_begin_to_its_result(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(2)
    async with (
        serving(settings_for(tmp_path), parts) as bench,
        plant(tmp_path, {"cell7": bench.url}) as gateway,
        gateway.client() as mes,
    ):
        watched = ("Ready", "State", "RunId", "LastResult", "CalibrationId")
        await mes.listen(*(f"cell7.Cell.{name}" for name in watched), events_of="cell7")
        await mes.waits("cell7.Cell.Ready", True)
        run_id = await mes.call("cell7.Cell.Start", "calibrate", "ticket-1")
        assert await mes.read("cell7.Cell.RunId") == run_id
        assert await mes.read("cell7.Cell.Ready") is False
        assert (await mes.read(f"{AUTOMATIC}.CurrentState")).Text == "SingleExecution"
        await gate.reached.wait()
        assert await mes.call("cell7.Cell.Start", "calibrate", "ticket-1") == run_id
        assert await refused(mes.call("cell7.Cell.Start", "verify", "ticket-2")) == "BadInvalidState"
        gate.open.set()
        ended = await mes.hears(Message="calibration finished")
        assert run_id in ended.ResultContent[0].Value
        await mes.waits("cell7.Cell.Ready", True)
        await mes.hears(Message="cell7: Ready")
        assert await mes.call("cell7.Cell.Start", "calibrate", "ticket-1") == run_id, "also when it is over"
        assert await mes.read("cell7.Cell.Ready") is True
        runs = (await bench.client.get("/runs")).json()["runs"]
        assert [run["id"] for run in runs] == [run_id]
        management = "cell7.ConfigurationManagement"
        page = (ua.Variant(10, ua.VariantType.UInt32), ua.Variant(0, ua.VariantType.UInt32), ua.Variant(0))
        complete, count, _, listed, _ = await mes.call(f"{management}.GetConfigurationList", *page)
        assert (complete, count, await mes.read("cell7.Cell.CalibrationId")) == (True, 1, "")
        chosen = ua.Variant(listed[0].InternalId, ua.VariantType.ExtensionObject)
        assert await mes.call(f"{management}.ActivateConfiguration", chosen) == 0
        current = (await bench.client.get("/calibrations/current")).json()
        await mes.waits("cell7.Cell.CalibrationId", current["calibration"]["id"])
        await mes.call(f"{management}.GetConfigurationList", *page)
        again = f"/calibrations/{current['calibration']['id']}/apply"
        assert (await bench.client.post(again, json={"applied_by": "somebody else"})).is_success
        assert await refused(mes.call(f"{management}.ActivateConfiguration", chosen)) == "BadInvalidState"
        elsewhere = ua.ConfigurationIdDataType(Id="../robot/jog?x=")
        wrong = ua.Variant(elsewhere, ua.VariantType.ExtensionObject)
        assert await refused(mes.call(f"{management}.ActivateConfiguration", wrong)) == "BadNotFound"
        assert await mes.read("cell7.Cell.U_Mm") == current["expanded_mm"]
        assert await mes.read("cell7.Cell.LastResult") == "finished"
        assert (await bench.client.post("/verify")).is_success
        by_rest = await mes.hears(Message="verify finished")
        assert (ended.MeasId.Id, by_rest.MeasId) == ("ticket-1", None), "it was started without a ticket"


@pytest.mark.slow
async def test_abort_ends_the_run_whoever_started_it_and_is_never_refused_for_want_of_knowledge(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with (
        serving(settings_for(tmp_path), parts) as bench,
        plant(tmp_path, {"cell7": bench.url}) as gateway,
        gateway.client() as scada,
    ):
        await scada.listen("cell7.Cell.Ready", "cell7.Cell.LastResult")
        await scada.waits("cell7.Cell.Ready", True)
        assert await scada.call("cell7.Cell.Abort") is None, "nothing to abort is no error"
        started = (await bench.client.post("/calibrate")).json()
        await gate.reached.wait()
        cause = (ua.Variant(0, ua.VariantType.Int32), "the operator's button")
        assert await scada.call(f"{AUTOMATIC}.Abort", *cause) == 0
        gate.open.set()
        run = (await bench.client.get(f"/runs/{started['id']}", params={"wait": LIMIT_S})).json()
        assert run["state"] == "aborted"
        await scada.waits("cell7.Cell.LastResult", "aborted")


@pytest.mark.slow
async def test_the_roles_of_the_daemon_s_keys_hold_and_what_is_not_for_plants_is_not_there(tmp_path: Path) -> None:
    async with with_keys(tmp_path) as (bench, keys):
        viewers = {"cell7": keys["viewer"]}
        async with plant(tmp_path, {"cell7": bench.url}, viewers) as gateway:
            async with gateway.client("panel", keys["viewer"]) as panel:
                await panel.listen("cell7.Cell.Ready")
                await panel.waits("cell7.Cell.Ready", True)
                assert await refused(panel.call("cell7.Cell.Start", "verify", "1")) == "BadUserAccessDenied"
                assert await refused(panel.call("cell7.Cell.Abort")) in ("accepted", "BadUserAccessDenied")
                assert await refused(panel.node("cell7.Cell.Ready").write_value(True)) == "BadUserAccessDenied"
            async with gateway.client("mes@cell7", keys["operator"]) as mes:
                assert await refused(mes.call("cell7.Cell.Start", "jog", "2")) == "BadInvalidArgument"
                for no_ticket in ("", "a space", "größer", "two\r\nlines"):
                    told = await refused(mes.call("cell7.Cell.Start", "calibrate", no_ticket))
                    assert told == "BadInvalidArgument", no_ticket
                cause = (ua.Variant(0, ua.VariantType.Int32), "")
                assert await refused(mes.call("cell7.VisionStateMachine.Reset", *cause)) == "BadNotSupported"
                assert await refused(mes.call("cell7.VisionStateMachine.Halt", *cause)) == "BadNotSupported"
                assert await mes.call("cell7.Cell.Start", "calibrate", "3")
            runs = (await bench.client.get("/runs", headers=bearer(keys["viewer"]))).json()["runs"]
            assert [run["kind"] for run in runs] == ["calibration"]


@pytest.mark.slow
async def test_nobody_enters_without_a_key_encryption_and_a_trusted_certificate(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with with_keys(tmp_path) as (bench, keys):
        viewers = {"cell7": keys["viewer"]}
        async with plant(tmp_path, {"cell7": bench.url}, viewers) as gateway:

            async def enters(label: str, key: str, trusted: bool = True) -> None:
                async with gateway.client(label, key, trusted) as client:
                    await client.read("cell7.Cell.Ready")

            assert await refused(enters("mes", keys["viewer"])) == "accepted"
            assert await refused(enters("mes", "hek_wrong")) == "BadUserAccessDenied"
            assert await refused(enters("mes@cell8", keys["viewer"])) == "BadUserAccessDenied"
            assert await refused(enters("stranger", keys["viewer"], trusted=False)) == "BadCertificateUntrusted"
            assert "refused: the certificate of CN=stranger-False" in caplog.text
            assert "BadCertificateUntrusted" in caplog.text
            async with gateway.client("mes", keys["viewer"]) as mes, gateway.client("panel", keys["viewer"]) as panel:
                tokens = [str(one.client.uaclient.session.authentication_token.Identifier) for one in (mes, panel)]
            assert sorted({len(token) for token in tokens}) == [32], "nobody guesses the token of another's session"
            assert len(set(tokens)) == 2
            plain = Client(gateway.endpoint, timeout=LIMIT_S)
            with pytest.raises((ua.UaError, ConnectionError, asyncio.TimeoutError)):
                async with plain:
                    await plain.nodes.objects.get_children()


@pytest.mark.slow
async def test_a_daemon_that_goes_is_not_ready_and_comes_back(tmp_path: Path) -> None:
    port = free_port()
    settings = settings_for(tmp_path, server={"port": port})
    async with AsyncExitStack() as staying, plant(tmp_path, {"cell7": f"http://127.0.0.1:{port}"}) as gateway:
        async with serving(settings):
            scada = await staying.enter_async_context(gateway.client())
            await scada.listen("cell7.Cell.Ready", "cell7.Cell.State", events_of="cell7")
            await scada.waits("cell7.Cell.Ready", True)
        await scada.waits("cell7.Cell.State", "Preoperational")
        assert await scada.read("cell7.Cell.Ready") is False
        assert await scada.read("cell7.Cell.Reason") == "the daemon does not answer"
        away = await scada.hears(ConditionName="daemon-away")
        assert (away.Retain, away.Severity) == (True, 800)
        async with gateway.client("late") as late:
            await late.listen(events_of="cell7", alarms=True)
            assert (await late.hears(ConditionName="daemon-away")).Retain is True
        assert await refused(scada.call("cell7.Cell.Start", "verify", "1")) == "BadCommunicationError"
        async with serving(settings):
            await scada.waits("cell7.Cell.Ready", True)
            assert await scada.read("cell7.Cell.State") == "Ready"
            assert (await scada.hears(ConditionName="daemon-away", Retain=False)).NodeId == away.NodeId
            async with gateway.client("later") as later:
                await later.listen(events_of="cell7", alarms=True)
                await later.hears(EventType=ua.NodeId(ua.ObjectIds.RefreshEndEventType))
                assert [event.Message.Text for event in later.events if event.ConditionName] == []
        await staying.aclose()


@pytest.mark.slow
@pytest.mark.parametrize("listens_at", ["cell7", "the Server object"])
async def test_who_comes_late_is_told_of_each_condition_between_the_frames_of_a_refresh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, listens_at: str
) -> None:
    gone = [{"name": name, "connected": False} for name in ("camera", "scanner", "robot")]

    async def shows(cell: Cell) -> None:
        await cell._on_change(CellState(reached=True, live={"devices": gone}))
        await cell._on_change(CellState(reached=True, live={"devices": gone[:2]}, store_sound=False))
        await asyncio.Event().wait()

    async def answers(*_: object, **__: object) -> object:
        return {"runs": []}

    monkeypatch.setattr(Cell, "follow", shows)
    monkeypatch.setattr(Cell, "get", answers)
    async with plant(tmp_path, {"cell7": "http://127.0.0.1:1"}) as gateway, gateway.client() as late:
        await late.listen("cell7.Cell.Ready")
        await late.listen(events_of=listens_at if listens_at == "cell7" else "", alarms=True)
        await late.hears(EventType=ua.NodeId(ua.ObjectIds.RefreshEndEventType))
        told = [event.ConditionName or event.EventType.Identifier for event in late.events]
        assert (told[0], told[-1]) == (ua.ObjectIds.RefreshStartEventType, ua.ObjectIds.RefreshEndEventType)
        assert sorted(told[1:-1]) == ["device-camera", "device-scanner", "store-unsound"]
        stopped = [event.ConditionName for event in late.events if event.StopReaction and event.BlockReaction]
        assert stopped == ["store-unsound"], "the only one for which the state machine went to Error"


@pytest.mark.slow
async def test_what_is_no_daemon_and_half_a_message_take_nothing_from_others(tmp_path: Path) -> None:
    """A server that answers all with an empty list, and a client that never ends its first message."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: 2\r\n\r\n[]")
        writer.close()

    odd = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with odd, serving(settings_for(tmp_path)) as bench:
        urls = {"cell7": bench.url, "odd": f"http://127.0.0.1:{odd.sockets[0].getsockname()[1]}"}
        async with plant(tmp_path, urls) as gateway, gateway.client("mes@cell7") as scada:
            assert await cut_off(gateway.endpoint), "256 kB without an end are too much"
            await scada.listen("cell7.Cell.Ready")
            await scada.waits("cell7.Cell.Ready", True)
            assert await scada.read("odd.Cell.State") == "Preoperational"


async def cut_off(endpoint: str) -> bool:
    """Whether the gateway ends a connection that sends ten chunks of 60 kB of one message, without a login."""
    host, _, port = endpoint.removeprefix("opc.tcp://").rstrip("/").partition(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    hello = struct.pack("<IIIIIi", 0, 65535, 65535, 0, 0, -1)
    writer.write(b"HELF" + struct.pack("<I", 8 + len(hello)) + hello)
    await reader.read(28)
    for number in range(1, 11):
        chunk = struct.pack("<IIII", 0, 0, number, 1) + bytes(60_000)
        writer.write(b"MSGC" + struct.pack("<I", 8 + len(chunk)) + chunk)
    try:
        async with asyncio.timeout(LIMIT_S):
            while await reader.read(1000):  # it may say why
                pass
    except ConnectionError:
        return True
    except TimeoutError:
        return False
    finally:
        writer.close()
    return True
