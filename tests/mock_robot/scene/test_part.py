"""The door is smooth, its distance is the true distance, and its triangles lie on it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calibration.transforms import Array
from mock_robot.scene.part import DOOR, Door, polygon_distance, surface_samples

X, Y = st.floats(-600, 600), st.floats(-300, 300)


def mesh(step_mm: float = 8.0, door: Door = DOOR) -> tuple[Array, NDArray[np.int32]]:
    """Vertices (n, 3) in the part frame and triangles (m, 3) seen counter-clockwise; edge vertices lie on the edge."""
    x, y = np.meshgrid(np.arange(-640.0, 640.0, step_mm), np.arange(-340.0, 340.0, step_mm))
    index = np.arange(x.size, dtype=np.int32).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    flat = np.column_stack([x.ravel(), y.ravel()])
    metal = door.edge_distance(*flat.T) < 0
    triangles = triangles[metal[triangles].any(axis=1)]
    flat = door.onto_metal(flat)
    used, renumbered = np.unique(triangles, return_inverse=True)
    vertices = np.column_stack([flat[used], door.height(*flat[used].T)])
    return vertices, renumbered.reshape(triangles.shape).astype(np.int32)


@given(X, Y)
def test_the_slope_is_the_derivative_of_the_height_and_bounded(x: float, y: float) -> None:
    px, py, step = np.array([x]), np.array([y]), 1e-4
    numeric_x = (DOOR.height(px + step, py) - DOOR.height(px - step, py)) / (2 * step)
    numeric_y = (DOOR.height(px, py + step) - DOOR.height(px, py - step)) / (2 * step)
    along_x, along_y = DOOR.slope(px, py)
    assert along_x == pytest.approx(numeric_x, abs=1e-6)
    assert along_y == pytest.approx(numeric_y, abs=1e-6)
    assert np.hypot(along_x, along_y) <= DOOR.steepest


@given(X, Y, X, Y, st.floats(0, 1))
def test_the_envelope_is_concave_and_never_below_the_skin(a: float, b: float, c: float, d: float, at: float) -> None:
    first, second = (np.array([a]), np.array([b])), (np.array([c]), np.array([d]))
    between = DOOR.envelope(at * first[0] + (1 - at) * second[0], at * first[1] + (1 - at) * second[1])
    assert between >= at * DOOR.envelope(*first) + (1 - at) * DOOR.envelope(*second) - 1e-9
    assert DOOR.envelope(*first) >= DOOR.height(*first)


@settings(max_examples=30)
@given(X, Y, st.floats(-4, 4))
def test_a_point_above_the_metal_deviates_by_its_height_along_the_normal(x: float, y: float, off: float) -> None:
    px, py = np.array([x]), np.array([y])
    if DOOR.edge_distance(px, py) > -10.0:
        return
    point = np.column_stack([px, py, DOOR.height(px, py)]) + off * DOOR.normal(px, py)
    assert DOOR.deviation(point) == pytest.approx(off, abs=1e-6)


def test_no_sampled_metal_is_nearer_than_the_deviation_says() -> None:
    rng = np.random.default_rng(0)
    metal = surface_samples(1.5)
    points = metal[rng.integers(0, len(metal), 2000)]
    points = points + rng.standard_normal((2000, 3)) * rng.choice([0.1, 1.0, 5.0, 15.0], (2000, 1))
    nearest, _ = cKDTree(metal).query(points)
    distance = np.abs(DOOR.deviation(points))
    assert np.all(distance <= nearest + 1e-4)
    assert np.all(distance >= nearest - 2.2), "samples are a diagonal apart at most"


def test_beside_the_metal_the_distance_goes_to_its_edge() -> None:
    x, y = np.array([0.0, 0.0, 700.0, 520.0]), np.array([180.0, -330.0, 0.0, 10.0])
    points = np.column_stack([x, y, DOOR.height(x, y)])
    to_edge = np.abs(DOOR.deviation(points))
    assert to_edge == pytest.approx(np.abs(DOOR.edge_distance(x, y)), rel=0.06)


def test_it_is_a_door_with_a_window_a_lock_and_a_handle() -> None:
    metal, window, lock = (np.array([-200.0]), np.array([0.0])), (np.array([0.0]), np.array([180.0])), DOOR.lock[:2]
    assert DOOR.edge_distance(*metal) < 0 < DOOR.edge_distance(*window)
    assert DOOR.edge_distance(np.array([lock[0]]), np.array([lock[1]])) == pytest.approx(DOOR.lock[2])
    handle = np.array([DOOR.handle[0]]), np.array([DOOR.handle[1]])
    assert DOOR.envelope(*handle) - DOOR.height(*handle) == pytest.approx(DOOR.handle_depth)
    assert np.ptp(surface_samples(5.0)[:, 0]) == pytest.approx(1195.0, abs=10.0)


def test_distance_to_a_square_is_exact() -> None:
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    x, y = np.array([0.0, 3.0, 2.0, 0.9]), np.array([0.0, 0.0, 2.0, 0.0])
    assert polygon_distance(x, y, square) == pytest.approx([-1.0, 2.0, np.sqrt(2), -0.1])


def test_the_mesh_lies_on_the_metal_and_covers_its_area() -> None:
    vertices, triangles = mesh(10.0)
    assert np.abs(DOOR.deviation(vertices)).max() < 1e-3
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(normals[:, 2] > -1e-6), "triangles face the viewer"
    flat_area = normals[:, 2].sum() / 2
    assert flat_area == pytest.approx(len(surface_samples(2.0)) * 4.0, rel=0.01)
