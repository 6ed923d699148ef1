"""Socket instructions on real sockets. Received bytes stay buffered until read, so a timeout loses nothing."""

import errno
import re
import socket
from contextlib import suppress
from random import Random
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.devices import SocketDevice
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import MAX_RAWBYTES, MAX_STRING_LENGTH, integer

MAX_WAIT_S = 9999999.0
DEFAULT_WAIT_S = 60.0
MIN_PORT = 1025
OWN_PORTS = range(20_000, 32_000)
"""Below the range Linux assigns to clients (net.ipv4.ip_local_port_range)."""
_ADDRESS = re.compile(r"\d+(\.\d+){3}")


def create(task: ProgramTask, slot: Slot) -> None:
    slot.value.create()
    task.services.devices.add(slot.value)


def bind(task: ProgramTask, slot: Slot, address: str, port: float) -> None:
    """Bind to an address of the controller. Port 0 chooses one that stays the mock's over a restart."""
    device: SocketDevice = slot.value
    end, number = device.require_open(), integer(port)
    device.require(device.state == "created", "ERR_SOCK_IS_BOUND", f"the socket is {device.state}")
    device.require(number == 0 or MIN_PORT <= number <= 65535, "ERR_SOCK_UNSPEC", f"port {number} is not free")
    present = task.services.devices.network and _ADDRESS.fullmatch(address) is not None
    device.require(present, "ERR_SOCK_ADDR_INVALID", f"the controller has no address {address}")
    try:
        _bind(end, address, number)
    except OSError as error:
        name = "ERR_SOCK_ADDR_INUSE" if error.errno == errno.EADDRINUSE else "ERR_SOCK_ADDR_INVALID"
        raise RapidError(name, f"{address}:{number}: {error.strerror}") from None
    device.state = "bound"
    task.services.devices.address = end.getsockname()


def _bind(end: socket.socket, address: str, number: int) -> None:
    """The system would give a port it chose to another client while a restart leaves it free."""
    for own in [number] if number else Random().sample(OWN_PORTS, 100):
        try:
            return end.bind((address, own))
        except OSError as error:
            taken = error
    raise taken


def listen(task: ProgramTask, slot: Slot) -> None:
    device: SocketDevice = slot.value
    device.require_open()
    device.require(device.state == "bound", "ERR_SOCK_NOT_BOUND", f"the socket is {device.state}")
    device.require(task.services.devices.network, "ERR_SOCK_UNSPEC", "the network is down")
    device.require_open().listen(4)
    device.require_open().setblocking(False)
    device.state = "listening"
    task.services.devices.reachable.set()


def accept(task: ProgramTask, slot: Slot, client: Slot, address: Slot | None, time: float | None) -> None:
    device: SocketDevice = slot.value
    device.require(client.value.end is None, "ERR_SOCK_IS_CONN", "the client socket is in use: close it first")
    while True:
        if not task.services.devices.network:
            device.close()
        end = device.require_open()
        device.require(device.state == "listening", "ERR_SOCK_NOT_BOUND", f"the socket is {device.state}")
        if not task.wait(_limit(time), end.fileno()):
            raise RapidError("ERR_SOCK_TIMEOUT", "nobody connected")
        with suppress(BlockingIOError):  # the connection was closed again
            connection, peer = end.accept()
            break
    client.value.connect(connection)
    task.services.devices.add(client.value)
    if address is not None:
        address.value = str(peer[0])


def receive(
    task: ProgramTask,
    slot: Slot,
    text: Slot | None,
    raw: Slot | None,
    wanted: float | None,
    got: Slot | None,
    time: float | None,
) -> None:
    """With \\ReadNoOfBytes all of them, otherwise what has arrived."""
    device: SocketDevice = slot.value
    if text is None and raw is None:
        raise RapidError("ERR_ARGVALERR", "give \\Str or \\RawData")
    most = MAX_STRING_LENGTH if text is not None else MAX_RAWBYTES
    least = 1 if wanted is None else integer(wanted)
    device.require(1 <= least <= most, "ERR_ARGVALERR", f"{least} bytes of at most {most}")
    limit_s = _limit(time)
    ends_s = None if limit_s is None else task.now_s() + limit_s
    while device.look(task.services.wire) < least and not device.over:
        left_s = None if ends_s is None else max(0.0, ends_s - task.now_s())
        if not task.wait(left_s, device.require_connected().fileno()):
            raise RapidError("ERR_SOCK_TIMEOUT", f"{len(device.arrived)} of {least} bytes came")
    waited = min(least, len(device.arrived))  # fewer when the peer has disconnected
    data = device.take(most if wanted is None else waited)
    if text is not None:
        text.value = data.decode("latin-1")
    if raw is not None:
        raw.value.fill(data)
    if got is not None:
        got.value = float(len(data))


def send(task: ProgramTask, slot: Slot, text: str | None, raw: Slot | None, count: float | None) -> None:
    if text is None and raw is None:
        raise RapidError("ERR_ARGVALERR", "give \\Str or \\RawData")
    data = text.encode("latin-1") if text is not None else content_of(raw, count)
    slot.value.send(data, task.services.wire)


def content_of(raw: Any, count: float | None) -> bytes:
    return bytes(raw.value.valid() if count is None else raw.value.read(1, integer(count)))


def close(task: ProgramTask, slot: Slot) -> None:
    slot.value.close()
    task.services.devices.drop(slot.value)


def _limit(time: float | None) -> float | None:
    seconds = DEFAULT_WAIT_S if time is None else time
    return None if seconds >= MAX_WAIT_S else max(0.0, seconds)


DOES = MappingProxyType(
    {
        "SocketCreate": create,
        "SocketBind": bind,
        "SocketListen": listen,
        "SocketAccept": accept,
        "SocketReceive": receive,
        "SocketSend": send,
        "SocketClose": close,
        "SocketPeek": lambda task, slot: float(slot.value.look(task.services.wire)),
    }
)
