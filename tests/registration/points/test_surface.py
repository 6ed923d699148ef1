"""Planes through neighbouring points, and how many points of a view are kept."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from registration.points.surface import limit_of, planes_of
from tests.support.cases import cases


@settings(max_examples=cases(50), deadline=None)
@given(
    seed=st.integers(0, 10**6),
    width_mm=st.sampled_from([3.0, 0.3, 0.03, 3e-3, 3e-4]),
    bow_share=st.sampled_from([0.0, 1e-6, 1e-3, 0.02, 0.3, 10.0]),
)
def test_a_patch_lies_about_its_plane_by_the_least_spread(seed: int, width_mm: float, bow_share: float) -> None:
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.normal(size=(40, 3, 3)))
    sides_mm = [5.0, width_mm, bow_share * width_mm]
    patches = random.uniform(-1, 1, (40, 14, 3)) * sides_mm @ rotation + random.uniform(-90, 90, (40, 1, 3))
    normals, spreads = planes_of(patches)
    across = patches - patches.mean(axis=1, keepdims=True)
    off = np.einsum("nki,ni->nk", across, normals)
    np.testing.assert_allclose(np.sum(off**2, axis=1), spreads[:, 0], rtol=0, atol=1e-9 * spreads.max())
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-12)
    assert np.all(np.diff(spreads, axis=1) >= 0)
    if bow_share == 0.0:
        np.testing.assert_allclose(off, 0.0, atol=1e-6)


@pytest.mark.parametrize("points", [np.zeros((2, 14, 3)), np.cumsum(np.ones((1, 14, 3)), axis=1)])
def test_points_in_one_place_or_on_a_line_have_some_unit_normal(points: np.ndarray) -> None:
    normals, spreads = planes_of(points)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert np.all(spreads[:, :2] < 1e-9)


@pytest.mark.parametrize(
    ("views", "refine", "limit"), [(1, False, 30_000), (100, False, 30_000), (200, False, 15_000), (200, True, 30_000),
                                   (5000, False, 10_000)]
)  # fmt: skip
def test_fewer_points_are_kept_of_each_of_many_views_that_are_only_compared(
    views: int, refine: bool, limit: int
) -> None:
    assert limit_of(views, refine=refine) == limit
