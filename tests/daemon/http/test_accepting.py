"""Connections are accepted as fast as they come, few begin in a turn, and an abort waits behind nobody."""

import asyncio
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import pytest
import uvloop

from daemon.http import accepting
from daemon.http.accepting import MAX_WAITING, Accepting
from daemon.http.listen_socket import open_listener
from tests.support.waiting import eventually

ABORT = b"POST /runs/r1/abort HTTP/1.1\r\n"
OTHER = b"GET /robot HTTP/1.1\r\n"
MAX_BEGUN = 4

Loops = Callable[[], asyncio.AbstractEventLoop]
either_loop = pytest.mark.parametrize("loops", [asyncio.new_event_loop, uvloop.new_event_loop])


class Listening:
    """A listener, its clients, and what has begun in which order."""

    def __init__(self, listener: socket.socket, ends: ExitStack) -> None:
        self.listener, self._ends = listener, ends
        self.begun: list[bytes] = []
        self.first_begun = asyncio.Event()
        self.accepting: Accepting | None = None

    def connect(self, sent: bytes) -> socket.socket:
        """A client that has sent this."""
        client = self._ends.enter_context(socket.create_connection(self.listener.getsockname()))
        client.sendall(sent)
        return client

    def accept(self, held: Callable[[], bool] = lambda: False) -> None:
        self.accepting = Accepting(self.listener, self._begin, MAX_BEGUN, held)
        self._ends.callback(self.accepting.close)

    def _begin(self, connection: socket.socket, address: str) -> None:
        assert address == "127.0.0.1"
        with connection:
            connection.setblocking(True)
            self.begun.append(connection.recv(100))
        self.first_begun.set()

    def queued(self) -> int:
        """Connections that the system holds until they are accepted."""
        return self.listener.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 28)[24]


@contextmanager
def listening() -> Iterator[Listening]:
    with open_listener("127.0.0.1", 0) as listener, ExitStack() as ends:
        yield Listening(listener, ends)


@either_loop
def test_all_are_accepted_and_begin_a_few_a_turn(loops: Loops) -> None:
    async def crowd() -> None:
        with listening() as here:
            for number in range(100):
                here.connect(str(number).encode())
            assert here.queued() == 100
            here.accept()
            while len(here.begun) < 100:
                before = len(here.begun)
                await asyncio.sleep(0)
                assert len(here.begun) <= before + MAX_BEGUN
                assert not here.begun or here.queued() == 0
            assert sorted(map(int, here.begun)) == list(range(100))

    with asyncio.Runner(loop_factory=loops) as runner:
        runner.run(crowd())


@either_loop
@pytest.mark.parametrize("position", [0, 50, 99])
def test_an_abort_begins_before_the_others_however_many_came_before_or_after(loops: Loops, position: int) -> None:
    async def crowd() -> None:
        with listening() as here:
            for number in range(100):
                here.connect(ABORT if number == position else OTHER)
            here.accept()
            await eventually(lambda: here.begun)
            assert here.begun[0] == ABORT

    with asyncio.Runner(loop_factory=loops) as runner:
        runner.run(crowd())


async def test_while_the_others_are_held_an_abort_begins() -> None:
    held = True
    with listening() as here:
        here.accept(lambda: held)
        for sent in (OTHER, ABORT, OTHER):
            here.connect(sent)
        await eventually(lambda: here.begun)
        assert here.begun == [ABORT]
        here.connect(ABORT)
        await eventually(lambda: len(here.begun) == 2)
        assert here.begun == [ABORT, ABORT]
        held = False
        await eventually(lambda: len(here.begun) == 4)


async def test_the_newest_of_too_many_begin_and_the_oldest_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accepting, "MAX_WAITING", 20)
    assert MAX_WAITING > 20
    with listening() as here:
        clients = [here.connect(str(number).encode()) for number in range(50)]
        here.accept()
        await eventually(lambda: len(here.begun) == 20)
        assert sorted(map(int, here.begun)) == list(range(30, 50))
        with pytest.raises(ConnectionResetError):
            clients[0].recv(1)


async def test_what_waits_is_closed_with_the_listener() -> None:
    with listening() as here:
        clients = [here.connect(OTHER) for _ in range(20)]
        here.accept()
        await here.first_begun.wait()
        assert here.accepting is not None
        here.accepting.close()
        begun = len(here.begun)
        with pytest.raises(ConnectionResetError):
            clients[0].recv(1)
        await asyncio.sleep(0)
        assert len(here.begun) == begun < 20


async def test_it_goes_on_after_descriptors_had_run_out(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(accepting, "PAUSE_S", 0.01)
    with listening() as here:
        here.connect(OTHER)
        failing = _OutOfDescriptors(here.listener)
        accepts = Accepting(failing, here._begin, MAX_BEGUN)  # type: ignore[arg-type] # what it uses of a socket
        try:
            await eventually(lambda: here.begun)
        finally:
            accepts.close()
        assert caplog.text.count("could not be accepted") == 1


class _OutOfDescriptors:
    """A listener whose first accept fails."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener, self._failed = listener, False
        self.fileno, self.setblocking = listener.fileno, listener.setblocking

    def accept(self) -> tuple[socket.socket, tuple[str, int]]:
        if not self._failed:
            self._failed = True
            raise OSError(24, "Too many open files")
        return self._listener.accept()  # type: ignore[return-value]
