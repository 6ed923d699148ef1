"""EGM packets, from bytes and back; and against a library that nobody here wrote."""

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.egm.messages import RobotSample, decode, encode
from protocols.egm.protobuf import NotEgm, double_field, integer_field, message_field

finite = st.floats(allow_nan=False, allow_infinity=False)
samples = st.builds(
    RobotSample,
    seqno=st.integers(0, 2**32 - 1),
    robot_ms=st.integers(0, 2**32 - 1),
    joints_deg=st.lists(finite, max_size=7).map(tuple),
    position_mm=st.tuples(finite, finite, finite),
    quaternion_wxyz=st.tuples(finite, finite, finite, finite),
    external_axes=st.lists(finite, max_size=6).map(tuple),
    time_us=st.integers(0, 2**50),
    motors_on=st.booleans(),
    program_running=st.booleans(),
)
SAMPLE = RobotSample(7, 123, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (515.0, 0.0, 712.0), (0.7, 0.1, 0.7, 0.0))


@given(samples)
def test_what_is_packed_is_read_again(sample: RobotSample) -> None:
    assert decode(encode(sample)) == sample


@given(st.binary(max_size=400))
def test_whatever_comes_is_a_sample_or_none(data: bytes) -> None:
    with suppress(NotEgm):
        assert isinstance(decode(data), RobotSample)


@given(st.integers(0, len(encode(SAMPLE)) - 1))
def test_a_packet_that_is_cut_off_is_never_another_sample(cut: int) -> None:
    try:
        shorter = decode(encode(SAMPLE)[:cut])
    except NotEgm:
        return
    assert shorter.position_mm == SAMPLE.position_mm  # only what comes after the pose may be missing


def test_fields_of_newer_controllers_are_passed_over_and_packed_joints_are_read() -> None:
    newer = (
        message_field(12, (integer_field(1, 1), double_field(2, 0.5)))
        + integer_field(11, 9)
        + b"\x7d"
        + struct.pack("<f", 1.0)
    )
    assert decode(encode(SAMPLE) + newer) == SAMPLE
    packed = message_field(1, (struct.pack("<6d", *SAMPLE.joints_deg),))
    position = message_field(1, (double_field(n, v) for n, v in enumerate(SAMPLE.position_mm, 1)))
    rotation = message_field(2, (double_field(n, v) for n, v in enumerate(SAMPLE.quaternion_wxyz, 1)))
    pose = message_field(2, (position, rotation))
    header = message_field(1, (integer_field(1, 7), integer_field(2, 123), integer_field(3, 2)))
    assert decode(header + message_field(2, (message_field(1, (packed,)), pose))) == SAMPLE


@pytest.mark.parametrize("kind", [0, 1, 3])
def test_a_message_that_is_no_robots_data_is_refused(kind: int) -> None:
    assert encode(SAMPLE).count(integer_field(3, 2)) >= 1
    with pytest.raises(NotEgm, match="not of a robot's data"):
        decode(encode(SAMPLE).replace(integer_field(3, 2), integer_field(3, kind), 1))
