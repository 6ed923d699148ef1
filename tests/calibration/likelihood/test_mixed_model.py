"""The estimator's sums: made once, taken apart again, and each the same as when it is made by itself."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.likelihood.estimate import exact_pixels, linearise
from calibration.likelihood.mixed_model import (
    MixedModel,
    Variances,
    per_view_equations,
    solve,
    trend_basis,
    with_trend,
    woodbury,
)
from calibration.preprocessing.prepare import PreparedSession
from calibration.solve import estimate_session
from calibration.solver.view_outliers import Selection
from tests.simulated.spoiled_sessions import cell

LEVELS = Variances(0.01, 1e-7, 0.01, 1e-8, 1e-3)


@pytest.fixture(scope="module", params=["eye-in-hand", "eye-to-hand"])
def solved(request: pytest.FixtureRequest) -> tuple[PreparedSession, Selection]:
    estimated = estimate_session(cell(41, 14, setup=request.param).problem)
    prepared, selection = estimated.prepared, estimated.selection
    return prepared, selection


def by_pixels(solved: tuple[PreparedSession, Selection]) -> MixedModel:
    prepared, selection = solved
    best, seen = selection.best, prepared.take(selection.used).seen
    return linearise(exact_pixels(seen, prepared.nuisances), best.chain, prepared.nuisances, best.z)


@pytest.mark.parametrize("follows", [False, True])
def test_what_the_views_say_adds_up(solved: tuple[PreparedSession, Selection], follows: bool) -> None:
    model = by_pixels(solved)
    if follows:
        model = with_trend(model, trend_basis(solved[1].best.chain.base_T_flange))
    np.testing.assert_allclose(model.total, model.per_view().sum(axis=0), rtol=1e-9, atol=1e-6)
    step = solve(model, LEVELS)
    information, gradient = per_view_equations(model, LEVELS, step)
    known = model.full_prior_information(LEVELS)
    scale = np.sqrt(np.diagonal(step.information))
    np.testing.assert_allclose(
        (information.sum(axis=0) + np.diag(known)) / np.outer(scale, scale),
        step.information / np.outer(scale, scale),
        atol=1e-9,
    )
    whole = gradient.sum(axis=0) + known * model.prior_offset
    np.testing.assert_allclose((whole - step.gradient) / scale, 0, atol=1e-6)
    assert model.corrections(step.K, step.b).shape == (14, 6)


def test_a_view_in_the_plane_of_the_image_is_no_error(solved: tuple[PreparedSession, Selection]) -> None:
    """Poses that a wrong X puts there, as of exchanged pictures: a point moves by more than numbers tell apart."""
    model = by_pixels(solved)
    K = woodbury(replace(model, by_robot=np.full_like(model.by_robot, 1e30)), LEVELS)
    assert np.all(np.isfinite(K))
