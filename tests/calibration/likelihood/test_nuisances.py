"""Print, lens and the arm's lengths as unknowns: their derivatives, their priors, and what a mixture of them means."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.knowledge import Knowledge, TargetKnowledge, prior_mixture
from calibration.likelihood.estimate import exact_pixels, linearise
from calibration.likelihood.mixed_model import MixedModel, Variances
from calibration.likelihood.noise_marginalisation import marginalise
from calibration.likelihood.nuisances import Nuisances
from calibration.observations.reprojection import pixel_residuals
from calibration.preprocessing.prepare import PreparedSession
from calibration.solve import estimate_session
from calibration.solver.view_outliers import Selection
from tests.simulated.spoiled_sessions import cell

LEVELS = Variances(0.0025, 1e-8, 0.01)


@pytest.fixture(scope="module")
def solved() -> tuple[PreparedSession, Selection]:
    estimated = estimate_session(cell(41, 6).problem)
    prepared, selection = estimated.prepared, estimated.selection
    return prepared, selection


@pytest.mark.parametrize("estimated", [False, True])
def test_derivatives_are_those_of_the_residuals(solved: tuple[PreparedSession, Selection], estimated: bool) -> None:
    """J'r is the gradient of half the sum of squares, by every one of them."""
    prepared, selection = solved
    nuisances = Nuisances.of(prepared.camera, prepared.nominal_mm, Knowledge(), estimated=estimated)
    seen, poses = prepared.seen, selection.best.chain.camera_T_target()
    z = 1e-3 * np.random.default_rng(3).standard_normal(len(nuisances))
    z[: nuisances.first_known] = 0.0

    def half_squares(at: np.ndarray) -> float:
        off = pixel_residuals(nuisances.seen_at(seen, at), nuisances.camera_at(at), poses)
        return 0.5 * float(np.sum(seen.weights[..., None] * off**2))

    gradient = nuisances.statistics(seen, poses, z).gradient[:, 6:].sum(axis=0)
    for place in range(len(nuisances)):
        tiny = 1e-6 * np.eye(len(z))[place]
        numeric = (half_squares(z + tiny) - half_squares(z - tiny)) / 2e-6
        assert numeric == pytest.approx(gradient[place], rel=1e-3, abs=1e-3 * abs(gradient).max() ** 0.5)


def test_a_mixture_of_one_component_is_that_normal_density(solved: tuple[PreparedSession, Selection]) -> None:
    prepared, selection = solved
    best, one = selection.best, prepared.nuisances.prior
    kept = replace(one, log_weights=np.zeros(1), information=one.usual[None], arm_share=one.arm_share[:1])
    nuisances = replace(prepared.nuisances, prior=kept)
    model: MixedModel = linearise(exact_pixels(prepared.seen, nuisances), best.chain, nuisances, best.z)
    mixed, plain = marginalise(model, LEVELS), marginalise(replace(model, mixture=None), LEVELS)
    np.testing.assert_allclose(mixed.b, plain.b, atol=1e-6 * np.abs(plain.b).max())
    np.testing.assert_allclose(np.diagonal(mixed.covariance), np.diagonal(plain.covariance), rtol=1e-6)
    assert mixed.log_evidence == pytest.approx(plain.log_evidence, abs=1e-6)


def test_probabilities_sum_to_one_and_the_size_is_against_the_arms_lengths() -> None:
    for knowledge in (Knowledge(), Knowledge(TargetKnowledge("certified", 0.0), "this-session", "absolute-accuracy")):
        mixture = prior_mixture(knowledge, 0.2, (0.25,))
        assert np.exp(mixture.log_weights).sum() == pytest.approx(1.0)
        assert np.all((mixture.arm_share > 0) & (mixture.arm_share < 1))
    printed, certified = (
        prior_mixture(Knowledge(target), 0.2).usual[0]
        for target in (TargetKnowledge(), TargetKnowledge("certified", 0.0))
    )
    assert printed < certified  # a print is known less well


@pytest.mark.parametrize(
    ("length_mm", "instrument", "share"),
    [(200.0, "ruler-class-2", 1.53e-3), (200.0, "ruler-class-1", 7.6e-4), (200.0, "calliper", 1.0e-4)],
)
def test_what_an_instrument_says_of_a_size(length_mm: float, instrument: str, share: float) -> None:
    """A ruler of class II is good to 0.5 mm up to a metre: 0.15 % of 200 mm, not the 0.05 % of its division."""
    found = TargetKnowledge.measured(length_mm, instrument)  # type: ignore[arg-type]
    assert found.size_sigma == pytest.approx(share, rel=0.02)
