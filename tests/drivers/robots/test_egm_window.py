"""Samples of the settling monitor that are late, lost, doubled or swapped on their way."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drivers.interfaces import Vibration
from drivers.robots.abb.egm_vibration import SILENT_AFTER_S, ReceivedSample, SampleWindow, vibration_of
from protocols.egm.messages import RobotSample
from tests.support.cases import cases, long_enough_s

pytestmark = pytest.mark.timeout(long_enough_s())

SAMPLE = RobotSample(0, 0, (0.0,) * 6, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
PERIOD_S = 0.004


def arrival(seqno: int, received_at_s: float) -> ReceivedSample:
    return ReceivedSample(received_at_s, replace(SAMPLE, seqno=seqno % 2**32))


@settings(max_examples=cases(300), deadline=None)
@given(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 40), max_size=100))
def test_an_old_sample_is_never_the_newest(first: int, order: list[int]) -> None:
    """`order`: which of the packets sent since `first` arrives, 4 ms after the one before."""
    window, newest = SampleWindow(), -1
    for i, sent in enumerate(order):
        assert window.add(arrival(first + sent, i * PERIOD_S)) == (sent > newest)
        newest = max(newest, sent)
        assert window.newest is not None
        assert window.newest.sample.seqno == (first + newest) % 2**32
    numbers = [(each.sample.seqno - first) % 2**32 for each in window.since(0.0)]
    assert numbers == sorted(set(numbers))


def test_a_stream_that_begins_anew_after_a_silence_is_taken_alone() -> None:
    window = SampleWindow()
    window.add(arrival(500, 0.0))
    assert not window.add(arrival(1, SILENT_AFTER_S))
    assert window.add(arrival(1, SILENT_AFTER_S + 0.1))
    assert [each.sample.seqno for each in window.since(0.0)] == [1]


def test_the_vibration_is_the_same_in_every_frame_that_stands_still() -> None:
    rng = np.random.default_rng(3)
    positions = rng.normal([900.0, 100.0, 700.0], 0.1, (60, 3))
    flange = Rotation.from_rotvec([0.3, 1.2, -0.4]) * Rotation.from_rotvec(rng.normal(0.0, 1e-3, (60, 3)))

    def seen(world_R_frame: Rotation, offset_mm: list[float]) -> Vibration:
        placed, turned = world_R_frame.apply(positions) + offset_mm, world_R_frame * flange
        quaternions = turned.as_quat(scalar_first=True)
        return vibration_of(
            [
                replace(SAMPLE, seqno=k, position_mm=tuple(placed[k]), quaternion_wxyz=tuple(quaternions[k]))
                for k in range(60)
            ]
        )

    in_world, hanging = seen(Rotation.identity(), [0.0] * 3), seen(Rotation.from_rotvec([np.pi, 0, 0]), [0, 1e3, 2e3])
    assert in_world.translation_mm > 0.1
    assert hanging.translation_mm == pytest.approx(in_world.translation_mm)
    assert hanging.rotation_rad == pytest.approx(in_world.rotation_rad)
