"""The estimator's sums: made once, taken apart again, and each the same as when it is made by itself."""

import numpy as np
import pytest

from calibration.likelihood.augmented_model import widened
from calibration.likelihood.estimate import linearise, measured
from calibration.likelihood.mixed_model import MixedModel, Variances, of_views, solve, with_trend
from calibration.likelihood.systematic_errors import CENTRE, trend_basis
from calibration.observations.reprojection import INTRINSICS
from calibration.preprocessing.prepare import Prepared
from calibration.solve import estimated
from calibration.solver.view_outliers import Selection
from tests.simulated.spoiled_sessions import cell

LEVELS = Variances(0.01, 1e-7, 0.01, 1e-8, 1e-3)


@pytest.fixture(scope="module", params=["eye-in-hand", "eye-to-hand"])
def solved(request: pytest.FixtureRequest) -> tuple[Prepared, Selection]:
    prepared, _, selection = estimated(cell(41, 14, setup=request.param).problem)
    return prepared, selection


def by_pixels(solved: tuple[Prepared, Selection], *columns: int) -> MixedModel:
    prepared, selection = solved
    best, free = selection.best, selection.best.free.copy()
    free[list(columns)] = True
    return linearise(measured(prepared.take(selection.used).seen, free), best.chain, best.camera, best.scale)


@pytest.mark.parametrize("columns", [(), CENTRE, (INTRINSICS,), (*CENTRE, INTRINSICS)])
def test_a_part_of_the_widest_model_is_that_model(solved: tuple[Prepared, Selection], columns: tuple[int, ...]) -> None:
    prepared, selection = solved
    free = selection.best.free.copy()
    free[list(columns)] = True
    part = widened(prepared.take(selection.used).seen, selection.best).freeing(free)
    alone = by_pixels(solved, *columns)
    for name in ("by_robot", "squares", "count", "known", "offset"):
        np.testing.assert_allclose(getattr(part, name), getattr(alone, name), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("follows", [False, True])
def test_what_the_views_say_adds_up(solved: tuple[Prepared, Selection], follows: bool) -> None:
    model = by_pixels(solved, *CENTRE)
    if follows:
        model = with_trend(model, trend_basis(solved[1].best.chain.base_T_flange))
    np.testing.assert_allclose(model.total, model.of_views().sum(axis=0), rtol=1e-9, atol=1e-6)
    step = solve(model, LEVELS)
    information, gradient = of_views(model, LEVELS, step)
    known = model.known_information(LEVELS)
    scale = np.sqrt(np.diagonal(step.information))
    np.testing.assert_allclose(
        (information.sum(axis=0) + np.diag(known)) / np.outer(scale, scale),
        step.information / np.outer(scale, scale),
        atol=1e-9,
    )
    np.testing.assert_allclose((gradient.sum(axis=0) - step.gradient) / scale, 0, atol=1e-6)
    assert model.corrections(step.K, step.b).shape == (14, 6)
