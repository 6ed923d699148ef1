"""The published bytes of docs/cb-link.md, one for one."""

import pytest

from protocols.cb.client import ClientSession
from protocols.cb.codes import REPLY_BIT, Command, Flag
from protocols.cb.controller import ControllerSession, RequestReceived
from protocols.cb.frames import Frame, FrameReader, fletcher16
from protocols.cb.layouts import pack, unpack
from protocols.cb.messages import Hello, Ping, Pose

PING_SEQ_1 = bytes.fromhex("43 42 01 01 01 00 00 00 00 00 88 0a")
HELLO_SEQ_2 = bytes.fromhex("43 42 01 02 02 00 00 00 08 00 94 c7 01 00 00 00 01 00 00 00")
POSE_HEADER_SEQ_3 = bytes.fromhex("43 42 01 83 03 00 00 00 44 00 27 41")
NINE_E9 = bytes.fromhex("46 1c 06 50")

POSE = Pose((515, 0, 712), (0.7071068, 0, 0.7071068, 0), (0, 0, 0, 0), (9e9,) * 6, 123456, Flag(7))


def test_a_client_sends_the_published_ping_and_hello():
    client = ClientSession(resynchronise=False)
    assert client.request(Ping()) == PING_SEQ_1
    client.abandon()
    assert client.request(Hello(1, 0, 1, 0)) == HELLO_SEQ_2


def test_a_controller_understands_the_published_ping_and_hello():
    controller = ControllerSession(resynchronise=False)
    assert controller.receive_data(PING_SEQ_1 + HELLO_SEQ_2) == [
        RequestReceived(1, Ping()),
        RequestReceived(2, Hello(1, 0, 1, 0)),
    ]


def test_a_pose_reply_has_the_published_header_and_length():
    encoded = Frame(Command.GET_POSE | REPLY_BIT, 3, pack(POSE)).encode()
    assert encoded[:12] == POSE_HEADER_SEQ_3
    assert len(encoded) == 80


def test_an_unused_axis_crosses_the_wire_as_8999999488():
    payload = pack(POSE)
    assert payload[36:60] == NINE_E9 * 6
    assert unpack(Pose, payload).external_axes == (8999999488.0,) * 6


@pytest.mark.parametrize(
    ("data", "expected"),
    [(b"", 0x0000), (b"abcde", 0xC8F0), (b"abcdef", 0x2057), (b"abcdefgh", 0x0627), (b"\xff" * 300, 0x0000)],
    ids=["empty", "abcde", "abcdef", "abcdefgh", "all ones"],
)
def test_fletcher16_against_values_from_the_literature(data, expected):
    assert fletcher16(data) == expected


@pytest.mark.parametrize("vector", [PING_SEQ_1, HELLO_SEQ_2], ids=["ping", "hello"])
def test_a_published_frame_survives_decoding_and_encoding(vector):
    (frame,) = FrameReader(resynchronise=False).feed(vector)
    assert isinstance(frame, Frame)
    assert frame.encode() == vector
