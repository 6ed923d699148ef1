"""Probing and spacing errors of a scanner whose errors are known."""

import numpy as np
import pytest

from calibration.transforms import Array
from registration.errors import SphereError
from registration.points.scanner_acceptance import evaluate_acceptance
from tests.registration.ball_bars import RADIUS_MM, SPACING_MM, ball, bar


def test_a_perfect_scanner_has_no_errors() -> None:
    found = evaluate_acceptance([bar(seed) for seed in range(3)], RADIUS_MM, SPACING_MM)
    assert found.form_mm == pytest.approx(0, abs=1e-5)
    assert found.size_mm == pytest.approx(0, abs=1e-5)
    assert found.spacing_mm == pytest.approx(0, abs=1e-5)
    assert [len(position.balls) for position in found.positions] == [2, 2, 2]


def test_each_error_is_found_for_itself_with_its_sign() -> None:
    found = evaluate_acceptance(
        [bar(1, noise_mm=0.05, larger_mm=-0.1), bar(2, longer_mm=-0.2, noise_mm=0.05)], RADIUS_MM, SPACING_MM
    )
    assert found.form_mm == pytest.approx(2 * 1.96 * 0.05, rel=0.1)  # 95 % of a normal distribution
    assert found.size_mm == pytest.approx(-0.2, abs=0.02)
    assert found.spacing_mm == pytest.approx(-0.2, abs=0.02)


def test_a_single_sphere_has_no_spacing() -> None:
    found = evaluate_acceptance([ball(np.array([0.0, 0, 500]), 1)], RADIUS_MM)
    assert found.spacing_mm is None


@pytest.mark.parametrize(
    ("clouds", "words"),
    [
        ([], "no positions"),
        ([bar(1), ball(np.array([0.0, 0, 500]), 1)], "position 1: "),
        ([np.full((500, 3), np.nan)], "position 0: "),
    ],
)
def test_what_is_no_ball_bar_names_its_position(clouds: list[Array], words: str) -> None:
    with pytest.raises(SphereError, match=words):
        evaluate_acceptance(clouds, RADIUS_MM, SPACING_MM)
