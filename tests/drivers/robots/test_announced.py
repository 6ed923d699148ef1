"""Controllers that announce themselves: the question on the wire, and whose answers are taken."""

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from drivers.robots.abb.rws.announced import find_announced
from tests.support.waiting import LIMIT_S, eventually_blocking

HERE = "127.0.0.1"


def name(*labels: str) -> bytes:
    """A domain name on the wire (RFC 1035, 3.1)."""
    return b"".join(bytes([len(label)]) + label.encode() for label in labels) + b"\0"


SERVICE = name("_http", "_tcp", "local")


def reply_of(instance: str) -> bytes:
    """A response with one PTR record (RFC 1035, 4.1; RFC 6762, 18)."""
    data = name(instance, "_http", "_tcp", "local")
    header = struct.pack(">6H", 0, 0x8400, 0, 1, 0, 0)
    return header + SERVICE + struct.pack(">HHIH", 12, 1, 10, len(data)) + data


@contextmanager
def responder(*replies: bytes) -> Iterator[tuple[tuple[str, int], list[bytes]]]:
    """Somebody who answers the first question with all of these; its address, and what it was asked."""
    asked: list[bytes] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as answers:
        answers.bind((HERE, 0))
        answers.settimeout(LIMIT_S)

        def answer() -> None:
            question, asker = answers.recvfrom(512)
            asked.append(question)
            for reply in replies:
                answers.sendto(reply, asker)

        thread = threading.Thread(target=answer)
        thread.start()
        yield answers.getsockname(), asked
        thread.join()


def test_a_controller_is_found_by_the_name_of_its_service() -> None:
    def found() -> bool:
        with responder(reply_of("Printer"), b"", reply_of("RobotWebServices_16-40217")) as (group, asked):
            hosts = find_announced([HERE], 0.5, group)
        assert asked == [struct.pack(">6H", 0, 0, 1, 0, 0, 0) + SERVICE + struct.pack(">2H", 12, 1)]
        return hosts == [HERE]

    eventually_blocking(found)  # a busy machine's replies come later


@pytest.mark.parametrize("replies", [(), (b"\0" * 4000,), (reply_of("Printer"),)], ids=["nobody", "noise", "another"])
def test_who_announces_another_service_is_no_controller(replies: tuple[bytes, ...]) -> None:
    with responder(*replies) as (group, _):
        assert find_announced([HERE], 0.2, group) == []


def test_a_pc_without_a_network_asks_nobody() -> None:
    assert find_announced([], 60.0) == []
    assert find_announced(["192.0.2.1"], 0.0) == []
