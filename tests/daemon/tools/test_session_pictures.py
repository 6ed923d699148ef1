"""Charts and arrows of the pages of residuals: geometry, not looks."""

import re

import numpy as np
import pytest

from calibration.solution import PointResiduals, ViewResult
from daemon.tools.session_pictures.overlay import arrow_magnification
from daemon.tools.session_pictures.write import Mark, bar_chart, image_chart, nice_ticks, scatter_chart


def result_of(length_px: float, outlier_px: float) -> ViewResult:
    """Ten points in use with residuals of one length, and an outlying one."""
    residuals = np.array([[length_px, 0.0]] * 10 + [[outlier_px, 0.0]])
    points = PointResiduals(np.zeros((11, 2)), residuals, np.ones(11), np.arange(11) < 10)
    return ViewResult(0, None, "used", None, length_px, 0.1, None, points)


@pytest.mark.parametrize(("length_px", "expected"), [(0.05, 500.0), (0.1, 200.0), (3.0, 10.0), (80.0, 1.0), (0.0, 1.0)])
def test_arrows_are_magnified_by_a_round_number(length_px: float, expected: float) -> None:
    assert arrow_magnification([result_of(length_px, 500.0)], 1000) == expected


def test_without_residuals_nothing_is_magnified() -> None:
    assert arrow_magnification([ViewResult(0, None, "used", None, None, None, None)], 1000) == 1.0


def test_arrows_start_at_their_pixel_and_are_as_long_as_said() -> None:
    drawn = image_chart(np.array([[100.0, 50.0]]), np.array([[0.2, -0.1]]), (640, 480), 100.0)

    assert "M100.0 50.0L120.0 40.0" in drawn


def test_a_common_error_of_the_lens_is_drawn_bold() -> None:
    pixels = np.array([[10.0, 10.0], [20.0, 30.0], [40.0, 20.0]])
    drawn = image_chart(pixels, np.array([[0.1, 0.0], [0.3, 0.0], [0.2, 0.0]]), (600, 400), 100.0)

    assert re.search(r'class="bold"[^>]*d="M25\.0 25\.0L45\.0 25\.0', drawn)


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.13), (412.0, 918.0), (5.0, 5.0), (0.0, 0.0), (-3.0, 1e6)])
def test_ticks_enclose_the_values(low: float, high: float) -> None:
    ticks = nice_ticks(low, high)

    assert ticks[0] <= low and ticks[-1] >= high
    assert 2 <= len(ticks) <= 8


@pytest.mark.parametrize("values", [[0.0], [0.1, 0.1], [1e-9, 200.0]])
def test_charts_are_finite_whatever_the_values(values: list[float]) -> None:
    marks = [Mark(float(index), value, "used", "") for index, value in enumerate(values)]

    for chart in (bar_chart(marks, "view", "px"), scatter_chart(marks, "mm", "px")):
        assert "nan" not in chart and "inf" not in chart.replace("infinite", "")
