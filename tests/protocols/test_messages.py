"""Every message against its literal bytes, and against an encoder written from the table alone."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.cb.codes import REPLY_BIT, Command, Flag, MoveKind, Status
from protocols.cb.errors import FieldOutOfRange, PayloadRefused
from protocols.cb.frames import Frame
from protocols.cb.layouts import ANSWERS, COMMAND_OF, REQUESTS, STRUCTS, good_status, pack, unpack
from protocols.cb.messages import (
    GetPose,
    Hello,
    Move,
    Pose,
    Refused,
    Request,
    SetArmed,
    Success,
)
from tests.protocols import by_hand
from tests.protocols.rows import ALL_ROWS, FLANGE, NO_AXES, REPLY_ROWS, REQUEST_ROWS, Row

each_row = pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: row.name)


def test_the_rows_leave_no_message_out():
    assert {type(row.message) for row in REQUEST_ROWS} == set(Request.__subclasses__()) == set(REQUESTS.values())
    assert {type(row.message) for row in REPLY_ROWS} == set(Success.__subclasses__()) == set(ANSWERS.values())


@each_row
def test_a_message_is_these_bytes(row: Row):
    is_reply = row in REPLY_ROWS
    command = COMMAND_OF[type(row.message)] | (REPLY_BIT if is_reply else 0)
    status = good_status(row.message) if is_reply else 0
    assert Frame(command, row.seq, pack(row.message), status).encode() == row.encoded


@each_row
def test_the_second_encoder_agrees(row: Row):
    assert by_hand.frame(row.name, row.seq, row.values, row.status) == row.encoded


@each_row
def test_these_bytes_are_the_message(row: Row):
    assert unpack(type(row.message), row.encoded[12:]) == row.message


@each_row
def test_a_payload_of_another_length_is_refused(row: Row):
    payload = row.encoded[12:]
    for wrong in (payload + b"\0", payload[:-1]):
        if len(wrong) != STRUCTS[type(row.message)].size:
            with pytest.raises(PayloadRefused, match="bytes instead of") as refused:
                unpack(type(row.message), wrong)
            assert refused.value.status is Status.BAD_LEN


@pytest.mark.parametrize(
    ("kind", "payload"),
    [
        (GetPose, b"\x02\x00"),
        (SetArmed, b"\x01\x00\x02\x00"),
        (Move, pack(Move(*FLANGE, NO_AXES, 100.0, MoveKind.LINEAR))[:-4] + b"\x03\x00\x00\x00"),
    ],
    ids=["frame 2", "armed 2", "kind 3"],
)
def test_a_field_that_means_nothing_is_refused(kind, payload):
    with pytest.raises(PayloadRefused) as refused:
        unpack(kind, payload)
    assert refused.value.status is Status.BAD_FIELD


@pytest.mark.parametrize(
    "message",
    [
        Hello(65536, 1, 1),
        Hello(1, 1, -1),
        Move((1e39, 0, 0), (1, 0, 0, 0), (0, 0, 0, 0), NO_AXES, 100.0, MoveKind.JOINT),
        Move((0, 0, 0), (1, 0, 0, 0), (0, 0, 40000, 0), NO_AXES, 100.0, MoveKind.JOINT),
        Move((0, 0), (1, 0, 0, 0), (0, 0, 0, 0), NO_AXES, 100.0, MoveKind.JOINT),
        Move(("x", 0, 0), (1, 0, 0, 0), (0, 0, 0, 0), NO_AXES, 100.0, MoveKind.JOINT),
    ],
    ids=["u16 too large", "u16 negative", "no float32", "no int16", "two coordinates", "text"],
)
def test_a_value_that_does_not_fit_is_our_own_mistake(message):
    with pytest.raises(FieldOutOfRange, match="cannot be packed"):
        pack(message)


def test_flags_without_a_name_are_kept():
    stands = Pose(*FLANGE, NO_AXES, 0, Flag(0x8100))
    assert unpack(Pose, pack(stands)).flags == 0x8100


def test_the_two_reserved_bytes_are_ignored():
    payload = pack(Pose(*FLANGE, NO_AXES, 5, Flag.AUTO))
    assert unpack(Pose, payload[:-2] + b"\xab\xcd") == unpack(Pose, payload)


@pytest.mark.parametrize(("status", "name"), [(10, "UNREACHABLE"), (17, "BAD_FIELD"), (999, "999")])
def test_a_refusal_has_the_name_of_its_status(status, name):
    assert Refused(status).name == name


@pytest.mark.parametrize(("minimum", "maximum", "spoken"), [(1, 1, True), (1, 0, True), (1, 9, True), (2, 3, False)])
def test_a_hello_names_its_versions(minimum, maximum, spoken):
    assert Hello(minimum, maximum, 1).speaks(1) is spoken


reals = st.floats(width=32, allow_nan=False)
shorts = st.integers(-32768, 32767)


@given(
    st.tuples(reals, reals, reals),
    st.tuples(reals, reals, reals, reals),
    st.tuples(shorts, shorts, shorts, shorts),
    st.tuples(reals, reals, reals, reals, reals, reals),
    reals,
    st.sampled_from(MoveKind),
)
def test_every_float32_move_survives_the_wire(position, quaternion, configuration, axes, speed, kind):
    move = Move(position, quaternion, configuration, axes, speed, kind)
    assert unpack(Move, pack(move)) == move


@given(st.integers(0, 2**32 - 1), st.integers(0, 65535))
def test_times_and_flags_survive_the_wire(t_ms, flags):
    pose = Pose(*FLANGE, NO_AXES, t_ms, Flag(flags))
    assert unpack(Pose, pack(pose)) == pose


def test_not_a_number_is_carried_for_the_driver_to_judge():
    pose = Pose((math.nan, 0, 0), *FLANGE[1:], NO_AXES, 0, Flag(0))
    assert math.isnan(unpack(Pose, pack(pose)).position_mm[0])


def test_replies_are_requests_with_the_top_bit():
    assert {by_hand.ROWS[row.name][0] for row in REPLY_ROWS} == {command | 0x80 for command in Command}
