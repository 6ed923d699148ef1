"""The prior of a target's size: a share beyond what prints can be needs stronger evidence than one within."""

from dataclasses import replace

import numpy as np
import pytest

import calibration.solver.target_scale_check as check
from calibration.likelihood.augmented_model import AugmentedModel, augment_model
from calibration.likelihood.mixed_model import MixedModel, Step, Variances
from calibration.observations.reprojection import INTRINSICS
from calibration.solve import estimate_session
from tests.simulated.spoiled_sessions import cell

VIEWS = 10


@pytest.fixture(scope="module")
def wider() -> AugmentedModel:
    """A clean session at its estimate, with the target's size among the unknowns that may be freed."""
    prepared, _, selection = estimate_session(cell(21, VIEWS).problem)
    return augment_model(prepared.take(selection.used).seen, selection.best)


def found(share: float, sigmas: float, wider: AugmentedModel, monkeypatch: pytest.MonkeyPatch) -> float:
    """The share that is taken up of an estimate `sigmas` of its standard deviations above 0."""

    def estimated(model: MixedModel, variances: Variances) -> Step:
        p = model.unknowns
        covariance = np.diag(np.append(np.ones(p - 1), (share / sigmas) ** 2))
        return Step(np.append(np.zeros(p - 1), share), np.eye(p), np.zeros(p), covariance, np.zeros(0), np.zeros(0))

    monkeypatch.setattr(check, "solve", estimated)
    monkeypatch.setattr(check, "estimate_variances", lambda model, variances: variances)
    return check.scale_error(wider)


@pytest.mark.parametrize(
    ("share", "sigmas", "taken_up"),
    [
        (0.001, 5.0, False),
        (0.001, 6.5, True),
        (-0.02, 6.5, True),
        (0.1, 6.5, False),
        (0.1, 8.0, True),
        (0.4, 7.0, False),
        (0.4, 12.0, True),
        (0.6, 50.0, False),  # another unit
        (1e-4, 50.0, False),  # paper in moist air
    ],
)
def test_the_further_from_what_prints_are_the_stronger_the_evidence_must_be(
    share: float, sigmas: float, taken_up: bool, wider: AugmentedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert found(share, sigmas, wider, monkeypatch) == (share if taken_up else 0.0)


def test_without_scatter_in_the_views_nothing_is_taken_up(wider: AugmentedModel) -> None:
    """The session is clean; and a size that is unknown already is not tested again."""
    assert check.scale_error(wider) == 0.0
    free = wider.best.free.copy()
    free[INTRINSICS] = True
    assert check.scale_error(replace(wider, best=replace(wider.best, free=free))) == 0.0
