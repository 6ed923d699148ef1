"""`handeyed.Client`, as a MES uses it: real daemons on real ports, and once the mock cell."""

import asyncio
import socket
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import TypeVar
from urllib.parse import urlsplit

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import transform_from_quaternion
from daemon.access.certificates import CERTIFICATE, PRIVATE_KEY, make_certificate
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text
from handeyed import Client, ClientError
from handeyed.client import Run
from handeyed.errors import ConnectionBroke, NoDaemon, NotAnAddress, Refused, RunFailed
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.clouds import POSE, cloud, in_base
from tests.daemon.fakes import Gate, ply_of

Answer = TypeVar("Answer")


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    async with serving(settings_for(tmp_path / "store", calibration={"policy": "operator"})) as found:
        yield found


async def asked(bench: Bench, question: Callable[[Client], Answer], url: str | None = None) -> Answer:
    """`question` in a thread, as the program of a MES: the daemon of these tests runs in this one."""

    def ask() -> Answer:
        with Client(url or bench.url) as cell:
            return question(cell)

    return await asyncio.to_thread(ask)


async def test_a_run_is_waited_for_and_its_result_activated(bench: Bench) -> None:
    def job(cell: Client) -> None:
        assert cell.current() is None
        run = cell.wait(cell.start("/calibrate", {"count": 3}))
        made = cell.result(run)
        assert (run["over"], made.id) == (True, cell.calibration(made.id).id)
        cell.activate(made.id, by="MES")
        now = cell.current()
        assert now is not None
        assert (now["calibration"]["id"], now["applied"]["applied_by"]) == (made.id, "MES")

    await asked(bench, job)


async def test_a_start_may_be_answered_when_the_run_is_over(bench: Bench) -> None:
    run = await asked(bench, lambda cell: cell.start("/calibrate", {"count": 3}, wait_s=100))
    assert run["state"] == "finished"


async def test_waiting_ends_after_its_limit_with_the_run_as_it_is(tmp_path: Path) -> None:
    parts, gate = Parts(), Gate(at_move=1)
    parts.robot.before_move = gate
    async with serving(settings_for(tmp_path), parts) as bench:
        run = await asked(bench, lambda cell: cell.wait(cell.start("/calibrate"), limit_s=0.1))
        assert not run["over"]
        gate.open.set()
        assert (await asked(bench, lambda cell: cell.wait(run)))["over"]


@asynccontextmanager
async def loses_answers(url: str, lost: int) -> AsyncIterator[str]:
    """A relay to `url` that ends its first `lost` connections once the daemon has answered, without the answer."""
    there, connections = urlsplit(url), count(1)
    relays: set[asyncio.Task[None]] = set()

    async def copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, *, lose: bool) -> None:
        while (content := await reader.read(65536)) and not lose:
            writer.write(content)
        writer.close()

    async def relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        lose = next(connections) <= lost
        current = asyncio.current_task()
        assert current is not None
        relays.add(current)
        back, ahead = await asyncio.open_connection(there.hostname, there.port)
        await asyncio.gather(copy(reader, ahead, lose=False), copy(back, writer, lose=lose))

    async with await asyncio.start_server(relay, "127.0.0.1", 0) as server:
        yield f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    await asyncio.gather(*relays)


async def test_a_start_whose_answer_is_lost_is_sent_again_and_starts_once(bench: Bench) -> None:
    async with loses_answers(bench.url, 2) as url:
        run = await asked(bench, lambda cell: cell.start("/calibrate", {"count": 3}, wait_s=100), url)
    assert run["state"] == "finished"
    assert [one["id"] for one in (await bench.client.get("/runs")).json()["runs"]] == [run["id"]]


async def test_after_three_lost_answers_the_program_goes_on_with_its_own_key(bench: Bench) -> None:
    async with loses_answers(bench.url, 3) as url:
        with pytest.raises(ConnectionBroke):
            await asked(bench, lambda cell: cell.start("/calibrate", {"count": 3}, retry_key="order-17"), url)
        run = await asked(bench, lambda cell: cell.start("/calibrate", {"count": 3}, retry_key="order-17"), url)
    assert [one["id"] for one in (await bench.client.get("/runs")).json()["runs"]] == [run["id"]]


async def test_a_retry_while_the_first_is_answered_follows_its_run(tmp_path: Path) -> None:
    """The first start still waits at the daemon when its program asks again."""
    parts, gate = Parts(), Gate(at_move=1)
    parts.robot.before_move = gate
    key = {"Idempotency-Key": "order-18"}
    async with serving(settings_for(tmp_path), parts) as bench:
        first = asyncio.create_task(bench.client.post("/calibrate?wait=200", headers=key, json={}))
        await gate.reached.wait()
        async with loses_answers(bench.url, 1) as url:
            start = lambda cell: cell.start("/calibrate", wait_s=0.1, retry_key="order-18")  # noqa: E731
            run: Run = await asked(bench, start, url)
        gate.open.set()
        assert (await first).json()["id"] == run["id"]


async def test_a_refusal_says_what_where_and_what_to_do(bench: Bench) -> None:
    with pytest.raises(Refused) as refused:
        await asked(bench, lambda cell: cell.start("/calibrate", {"cuont": 3}))
    error = refused.value
    assert (error.status, error.code, error.where) == (422, "document-refused", f"{bench.url}/calibrate")
    assert error.problem["problems"][0]["fix"] == "did you mean 'count'?"
    assert isinstance(error, ClientError)


async def test_a_refusal_that_passes_says_when_to_ask_again(tmp_path: Path) -> None:
    parts, gate = Parts(), Gate(at_move=1)
    parts.robot.before_move = gate
    async with serving(settings_for(tmp_path), parts) as bench:
        run = await asked(bench, lambda cell: cell.start("/calibrate"))
        with pytest.raises(Refused) as refused:
            await asked(bench, lambda cell: cell.start("/verify"))
        assert refused.value.code == "run-in-progress"
        assert refused.value.retry_after_s is not None
        ended = await asked(bench, lambda cell: cell.abort(run))
        with pytest.raises(RunFailed, match="aborted"):
            await asked(bench, lambda cell: cell.result(ended))
        gate.open.set()


async def test_what_failed_says_why(tmp_path: Path) -> None:
    parts = Parts()
    parts.camera.blind = lambda picture: True
    async with serving(settings_for(tmp_path), parts) as bench:
        run = await asked(bench, lambda cell: cell.start("/calibrate", wait_s=100))
        assert run["state"] == "failed"
        with pytest.raises(RunFailed) as failed:
            await asked(bench, lambda cell: cell.result(run))
    assert run["cause"] is not None
    assert (failed.value.code, failed.value.what) == (run["cause"]["code"], run["cause"]["what"])


async def test_a_decision_is_refused_when_another_calibration_is_active_meanwhile(bench: Bench) -> None:
    await apply_calibration(bench)
    seen = await asked(bench, lambda cell: cell.current())
    assert seen is not None
    known = seen["calibration"]["id"]
    await asked(bench, lambda cell: cell.activate(known, by="Ann", replacing=seen))
    with pytest.raises(Refused) as refused:
        await asked(bench, lambda cell: cell.activate(known, by="MES", replacing=seen))
    assert refused.value.code == "applied-meanwhile"


async def test_points_and_files_arrive_in_the_base_frame(bench: Bench, tmp_path: Path) -> None:
    await apply_calibration(bench)
    points, numbers = cloud(1000), [float(part) for part in POSE.split(",")]
    base_T_flange = transform_from_quaternion(numbers[:3], numbers[3:])
    placed = await asked(bench, lambda cell: cell.register(points, base_T_flange))
    assert placed == pytest.approx(in_base(points), abs=1e-3)
    here = await asked(bench, lambda cell: cell.register(points))
    stood = PoseDocument.model_validate((await bench.client.get("/robot")).json()["base_T_flange"]).transform()
    assert here == pytest.approx(await asked(bench, lambda cell: cell.register(points, stood)), abs=1e-3)
    (tmp_path / "part.ply").write_bytes(ply_of(points))
    out = tmp_path / "out.ply"
    size = await asked(bench, lambda cell: cell.register_file(tmp_path / "part.ply", out, base_T_flange))
    assert size == out.stat().st_size
    assert out.read_bytes().startswith(b"ply")
    with pytest.raises(ClientError, match=r"'\.stl' is no cloud's"):
        await asked(bench, lambda cell: cell.register_file(tmp_path / "part.stl", out))
    with pytest.raises(Refused):
        await asked(bench, lambda cell: cell.register(np.zeros((0, 3)), unit="feet"))
    for wrong in [(points.T, base_T_flange), (points, base_T_flange.T)]:
        with pytest.raises(ClientError, match="give"):
            await asked(bench, lambda cell, wrong=wrong: cell.register(*wrong))


async def test_events_go_on_where_they_ended(bench: Bench) -> None:
    def first(cell: Client) -> list[dict[str, object]]:
        run = cell.start("/calibrate", {"count": 3}, wait_s=100)
        events = cell.events(after=0)
        seen = []
        for event in events:
            seen.append(event)
            if event["event"] == "run" and event["id"] == run["id"] and event["state"] == "finished":
                return seen
        return seen

    seen = await asked(bench, first)
    numbers = [int(str(event["number"])) for event in seen]
    assert numbers == sorted(set(numbers))
    assert {"run", "calibration"} <= {event["event"] for event in seen}
    following = await asked(bench, lambda cell: next(cell.events(after=numbers[0])))
    assert following == seen[1]


async def test_a_run_is_followed_through_its_events(bench: Bench) -> None:
    states: list[str] = []
    run = await asked(bench, lambda cell: cell.follow("/calibrate", {"count": 3}, lambda e: states.append(e["state"])))
    assert (run["state"], states[-1]) == ("finished", "finished")
    assert "capturing" in states


async def test_ctrl_c_while_a_run_is_followed_stops_the_arm(bench: Bench) -> None:
    def interrupt(event: dict[str, object]) -> None:
        raise KeyboardInterrupt

    def follow(cell: Client) -> bool:
        with pytest.raises(KeyboardInterrupt):
            cell.follow("/calibrate", {}, interrupt)
        return True

    assert await asked(bench, follow)
    run = (await bench.client.get("/runs")).json()["runs"][0]
    assert (await bench.run_over(f"/runs/{run['id']}"))["state"] == "aborted"


async def test_with_a_key_and_over_tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tls = tmp_path / "tls"
    make_certificate(tls, ["localhost"], datetime.now(UTC))
    files = {"certificate": str(tls / CERTIFICATE), "private_key": str(tls / PRIVATE_KEY)}
    async with serving(settings_for(tmp_path / "store", server=files)) as bench:
        key = (await bench.client.post("/keys", json={"name": "MES", "role": "operator"})).json()["key"]

        def runs(**access: str) -> object:
            with Client(bench.url, **access) as cell:  # type: ignore[arg-type]
                return cell.get("/runs")["runs"]

        authority = str(tls / "authority.pem")
        assert await asyncio.to_thread(runs, key=key, ca=authority) == []
        with pytest.raises(ClientError, match="its certificate is not trusted"):
            await asyncio.to_thread(runs, key=key)
        with pytest.raises(Refused) as refused:
            await asyncio.to_thread(runs, ca=authority)
        assert (refused.value.status, refused.value.code) == (401, "key-missing")
        monkeypatch.setenv("HANDEYED_KEY", key)
        monkeypatch.setenv("HANDEYED_CA", authority)
        assert await asyncio.to_thread(runs) == []


async def test_an_address_with_tls_where_there_is_none(bench: Bench) -> None:
    def health() -> object:
        with Client(bench.url.replace("http:", "https:")) as cell:
            return cell.get("/health")

    with pytest.raises(ClientError, match=r"speaks no TLS: begin its address with http://"):
        await asyncio.to_thread(health)


@pytest.mark.parametrize(
    ("url", "error"),
    [("ftp://cell", NotAnAddress), ("http://a..b:1", NotAnAddress), ("http://127.0.0.1:{free}", NoDaemon)],
)
def test_where_no_daemon_is(url: str, error: type[ClientError]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        free = taken.getsockname()[1]
    with pytest.raises(error), Client(url.format(free=free)) as cell:
        cell.get("/health")


@pytest.mark.parametrize(
    ("answer", "what"),
    [
        ("404 Not Found\r\n", "HTTP 404 Not Found"),
        ("200 OK\r\nContent-Type: text/html\r\n", "HTTP 200 OK, text/html"),
        ("302 Found\r\nLocation: /sign-in\r\n", "HTTP 302 Found"),
    ],
)
@pytest.mark.parametrize(
    "question",
    [
        lambda cell, _: cell.get("/runs"),
        lambda cell, _: cell.current(),
        lambda cell, _: cell.start("/calibrate"),
        lambda cell, _: cell.register([[0.0, 0.0, 500.0]]),
        lambda cell, folder: cell.register_file(folder / "in.bin", folder / "out.bin"),
        lambda cell, _: next(cell.events()),
    ],
)
def test_what_is_no_daemon_is_named_by_its_answer(
    question: Callable[[Client, Path], object], answer: str, what: str, tmp_path: Path
) -> None:
    (tmp_path / "in.bin").write_bytes(bytes(12))
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(f"HTTP/1.1 {answer}Content-Length: 0\r\n\r\n".encode())

        other = threading.Thread(target=serve)
        other.start()
        url = f"http://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(Refused, match=what) as refused, Client(url) as cell:
            question(cell, tmp_path)
        other.join()
    assert refused.value.code == "" and not (tmp_path / "out.bin").exists()


@pytest.mark.parametrize("key", ["hek_\u00fc\u00fc\u00fc", "hek_a\nb"])
def test_what_no_header_can_hold_is_refused_and_not_shown(key: str) -> None:
    with pytest.raises(ClientError, match=r"^key: it has characters that a header cannot hold") as refused:
        Client(key=key)
    assert "hek_" not in str(refused.value)
    with pytest.raises(ClientError, match=r"^retry_key:"), Client(key="hek_of_a_file\n") as cell:
        cell.start("/calibrate", retry_key=key)


async def test_a_file_is_replaced_by_a_whole_one_only(bench: Bench, tmp_path: Path) -> None:
    await apply_calibration(bench)
    part, out = tmp_path / "part.ply", tmp_path / "out.ply"
    part.write_bytes(ply_of(cloud(200_000)))
    size = await asked(bench, lambda cell: cell.register_file(str(part), str(out)))
    out.write_bytes(b"as before")
    cut = tmp_path / "cut.ply"
    cut.write_bytes(part.read_bytes()[:-7])
    for bad in (cut, tmp_path / "missing.ply"):
        with pytest.raises(ClientError):
            await asked(bench, lambda cell, bad=bad: cell.register_file(bad, out))
        assert out.read_bytes() == b"as before"
    with pytest.raises(ClientError, match="check path, rights"):
        await asked(bench, lambda cell: cell.register_file(part, tmp_path / "no" / "out.ply"))
    assert await asked(bench, lambda cell: cell.register_file(part, part)) == size, "also in its own place"


@pytest.mark.slow
def test_the_mock_cell_is_calibrated_and_a_cloud_placed(tmp_path: Path) -> None:
    mock = ["mock_robot", "run", "--with-parent", "--time-scale", "100"]
    with start_child("mock", mock, tmp_path) as running:
        settings = tmp_path / "handeyed.toml"
        settings.write_text(settings_text(running.announcement, 0))
        with (
            start_child("daemon", ["daemon.cli", "serve", str(settings)], tmp_path) as daemon,
            Client(daemon.announcement["url"]) as cell,
        ):
            made = cell.result(cell.start("/calibrate", wait_s=300))
            assert made.verdict.accepted
            now = cell.current()
            assert now is not None and now["calibration"]["id"] == made.id
            assert now["expanded_mm"] <= now["tolerance_mm"]
            assert cell.register([[0.0, 0.0, 500.0]]).shape == (1, 3)
