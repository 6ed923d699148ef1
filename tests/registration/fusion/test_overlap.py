"""Only views that can overlap are compared, and none that does is left out."""

import numpy as np

from calibration.transforms import rotation_from_vector, transform
from registration.fusion.overlap import correspond, pairs_within
from registration.points.surface import Surface

REACH_MM = 4.0


def a_plate(turn: float, x_mm: float) -> tuple[Surface, np.ndarray]:
    side = np.linspace(-20.0, 20.0, 21)
    points = np.stack([*map(np.ravel, np.meshgrid(side, side)), np.full(441, 300.0)], axis=1)
    return Surface.of(points), transform(rotation_from_vector([0.0, 0.0, turn]), [x_mm, 0.0, 0.0])


def test_pairs_left_out_have_no_counterpart() -> None:
    surfaces, poses = zip(*(a_plate(0.3 * index, 25.0 * index) for index in range(8)), strict=True)
    listed = set(pairs_within(surfaces, poses, REACH_MM))
    every = {(a, b) for a in range(8) for b in range(8) if a != b}
    assert 0 < len(listed) < len(every)
    for a, b in every - listed:
        assert len(correspond(surfaces[a], poses[a], surfaces[b], poses[b], REACH_MM).gaps) == 0


def test_views_of_one_gap_apart_are_compared_and_of_more_are_not() -> None:
    first, second = a_plate(0.0, 0.0), a_plate(0.0, 43.9)
    surfaces = [first[0], second[0]]
    assert pairs_within(surfaces, [first[1], second[1]], REACH_MM) == [(0, 1), (1, 0)]
    assert pairs_within(surfaces, [first[1], a_plate(0.0, 44.1)[1]], REACH_MM) == []
    assert pairs_within([], [], REACH_MM) == []
