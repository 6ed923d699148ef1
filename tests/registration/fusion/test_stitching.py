"""The gap between two views: of a plane along its normal, of an edge along two, of a corner along three directions."""

import numpy as np
import pytest

from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from registration.errors import ScanError
from registration.fusion.stitching import StitchedPairDocument, measure_gap
from registration.points.surface import Surface

FIRST = transform(rotation_from_vector([np.pi, 0.1, 0.0]), [20.0, -30.0, 500.0])
SECOND = transform(rotation_from_vector([np.pi - 0.2, 0.3, 0.5]), [-40.0, 50.0, 480.0])


def faces(count: int, rng: np.random.Generator) -> Array:
    """Points (n, 3) of `count` faces of a cube's corner that points upwards, 80 mm long."""
    normals = np.array([[1.0, 0, 1], [-0.5, 0.87, 1], [-0.5, -0.87, 1]])[:count]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = []
    for index, normal in enumerate(normals):
        u = np.cross(normal, normals[index - 1] if count > 1 else [0, 1.0, 0])
        u /= np.linalg.norm(u)
        v = np.cross(normal, u)
        v *= np.sign(-v[2]) or 1.0
        flat = rng.uniform([-40, 0], [40, 80], (4000, 2))
        points.append(flat[:, :1] * u + flat[:, 1:] * v)
    return np.concatenate(points)


def gap(count: int, off_mm: Array, noise_mm: float = 0.02, reach_mm: float | None = None) -> StitchedPairDocument:
    """Of two views of the faces, the second `off_mm` too far in the base."""
    rng = np.random.default_rng(count)
    views = []
    for pose in (FIRST, SECOND):
        seen = faces(count, rng)
        views.append(Surface.of(map_points(inverse(pose), seen + rng.normal(0, noise_mm, seen.shape))))
    moved = SECOND.copy()
    moved[:3, 3] += off_mm
    return measure_gap((0, 1), (views[0], FIRST), (views[1], moved), reach_mm)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_views_that_lie_on_each_other_have_no_gap(count: int) -> None:
    found = gap(count, np.zeros(3))
    assert abs(found.gap_mm) < 0.01
    assert np.linalg.norm(found.base_offset_mm) < 0.02
    assert len(found.directions) == count
    assert found.overlap > 0.7


def test_a_plane_shows_the_shift_along_its_normal_and_nothing_else() -> None:
    normal = np.array([1.0, 0, 1]) / np.sqrt(2)
    found = gap(1, 0.5 * normal + np.array([0.0, 0.7, 0.0]))
    assert found.gap_mm == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(found.base_offset_mm, 0.5 * normal, atol=0.03)
    assert found.width_mm < 0.2
    assert found.sigma_mm[0] < 0.01


@pytest.mark.parametrize("off_mm", [[0.4, 0.0, 0.2], [0.0, -0.6, 0.0], [-0.2, 0.3, 0.3]])
def test_a_corner_shows_the_whole_shift(off_mm: list[float]) -> None:
    np.testing.assert_allclose(gap(3, np.array(off_mm)).base_offset_mm, off_mm, atol=0.06)


def test_an_edge_shows_the_shift_across_it() -> None:
    off = np.array([0.3, 0.1, 0.5])
    found = gap(2, off)
    directions = np.array(found.directions)
    shown = directions.T @ directions @ off
    np.testing.assert_allclose(found.base_offset_mm, shown, atol=0.06)


def test_a_large_gap_is_found_when_looked_for_further() -> None:
    off = 8.0 * np.array([1.0, 0, 1]) / np.sqrt(2)
    with pytest.raises(ScanError, match="counterparts within"):
        gap(1, off)
    assert gap(1, off, reach_mm=20.0).gap_mm == pytest.approx(8.0, abs=0.05)
