"""The data channel of Gocator profilers: bytes laid out by hand after LMI's manual, cut anywhere, and damaged."""

import struct

import pytest

from protocols.gocator.data_channel import (
    LAST,
    DataChannel,
    NotGocator,
    ProfileGroup,
    RawProfiles,
    Stamp,
    encode,
)


def stamp_message(*stamps, last=False):
    """By the manual's table "Stamp": header, count, size, source, reserved, then 56 bytes a stamp."""
    body = b"".join(struct.pack("<QQqqQI12x", index, time_us, 0, 0, 0, 12345) for index, time_us in stamps)
    return struct.pack("<IHIHBB", 14 + len(body), 1 | LAST * last, len(stamps), 56, 0, 0) + body


def profile_message(values, *, kind=5, width=2, attributes=40, last=True):
    """By the manual's tables "Profile Point Cloud" (5) and "Uniform Profile" (6)."""
    count = len(values) // width // (2 if kind == 5 else 1)
    fixed = struct.pack("<HIIIIii", attributes, count, width, 1000, 2000, -3000, 400_000)
    body = fixed + bytes(attributes - 24) + struct.pack(f"<{len(values)}h", *values)
    return struct.pack("<IH", 6 + len(body), kind | LAST * last) + body


GROUP = ProfileGroup(
    (Stamp(7, 1_000_500),),
    RawProfiles(False, 1, 2, 1000, 2000, -3000, 400_000, struct.pack("<4h", 10, 20, -32768, -32768)),
)
BYTES = stamp_message((7, 1_000_500)) + profile_message([10, 20, -32768, -32768])


@pytest.mark.parametrize("attributes", [32, 40, 48])
def test_values_are_found_whatever_the_firmware_puts_before_them(attributes):
    data = stamp_message((7, 1_000_500)) + profile_message([10, 20, -32768, -32768], attributes=attributes)
    assert list(DataChannel().receive(data)) == [GROUP]


def test_bytes_may_be_cut_anywhere():
    channel = DataChannel()
    assert [group for n in range(len(BYTES)) for group in channel.receive(BYTES[n : n + 1])] == [GROUP]


def test_a_uniform_profile_has_z_alone():
    (group,) = DataChannel().receive(stamp_message((1, 5)) + profile_message([3, 4, 5], kind=6, width=3))
    assert group.profiles.uniform
    assert struct.unpack("<3h", group.profiles.values) == (3, 4, 5)


def test_messages_of_other_types_are_passed_over():
    other = struct.pack("<IH", 10, 10) + b"1234"
    alone = struct.pack("<IH", 10, 10 | LAST) + b"1234"
    data = alone + stamp_message((7, 1_000_500)) + other + profile_message([10, 20, -32768, -32768])
    assert list(DataChannel().receive(data)) == [GROUP]


def test_what_is_encoded_is_read_again():
    assert list(DataChannel().receive(encode(GROUP) * 3)) == [GROUP] * 3


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"HTTP/1.1 200 OK\r\n", "a message of"),
        (struct.pack("<IH", 5, 1), "a message of 5 bytes"),
        (struct.pack("<IHI", 10, 1, 1), "too short"),
        (stamp_message((1, 5))[:4] + struct.pack("<HIHBB", 1, 2, 56, 0, 0) + bytes(56), "with 2 stamps"),
        (struct.pack("<IH", 20, 5) + bytes(14), "too short"),
        (struct.pack("<IHHIIIIii", 32, 5, 24, 9, 9, 1, 1, 0, 0), "9 profiles of 9 points"),
        (profile_message([1, 2, 3, 4]), "1 profiles and 0 stamps"),
        ((struct.pack("<IH", 6, 10)) * 300, "more than 256 messages"),
    ],
)
def test_other_bytes_are_refused(data, what):
    with pytest.raises(NotGocator, match=what):
        list(DataChannel().receive(data))
