"""The chart's mathematics: a steady cell is left alone, a drift is found, and nothing hides itself."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.monitoring.control_chart import (
    ChartSample,
    DriftRules,
    chart,
    sample_of,
    scatter_limit_mm,
)
from calibration.transforms import map_points, rotation_from_vector, transform
from tests.daemon.fakes import BASE_T_TARGET, BOARD
from tests.simulated.drift import NOISE_MM, OF_A_VERIFICATION_MM, Cell, delays, first_alarm, ramp, steady, step

MIDDLE = BOARD.points_mm.mean(axis=0)


def at(*centres_x_mm: float, scatter_mm: float = 0.05) -> list[ChartSample]:
    return [ChartSample(np.array([x, 0.0, 0.0]), scatter_mm, 3) for x in centres_x_mm]


def test_nothing_is_said_before_the_target_is_learnt() -> None:
    assert chart([], DriftRules()) == []
    entries = chart(at(0, 9, 0, 9, 0), DriftRules(learn=5))
    assert [entry.standing for entry in entries] == ["learning"] * 5
    assert not any(entry.average_mm.any() for entry in entries)


def test_nothing_is_learnt_from_what_is_out_of_tolerance() -> None:
    """A camera that is knocked while the chart learns: 0.3, 4.9, 9.0, 30.4 and 9.4 mm were learnt, and 28.6 steady."""
    found = zip(at(0.0, 3.0, -5.0, 9.0, 4.0, 8.0), (0.3, 4.9, 9.0, 30.4, 9.4, 28.6), strict=True)
    entries = chart([replace(sample, within_tolerance=U <= 1.0) for sample, U in found], DriftRules(learn=5))
    out = "out-of-tolerance"
    assert [entry.standing for entry in entries] == ["learning", out, out, out, out, out]
    assert not np.isfinite(entries[-1].limit_mm)


def test_one_that_is_out_of_tolerance_changes_nothing_for_those_after_it() -> None:
    still = at(*np.random.default_rng(1).normal(0, 0.03, 12))
    spoiled = [*still[:8], replace(still[7], centre_mm=np.full(3, 9.0), within_tolerance=False), *still[8:]]
    without, beside = chart(still, DriftRules()), chart(spoiled, DriftRules())
    assert beside[8].standing == "out-of-tolerance"
    for one, other in zip(without[8:], beside[9:], strict=True):
        assert (one.standing, one.drift_mm, one.limit_mm) == (other.standing, other.drift_mm, other.limit_mm)


def test_the_average_is_the_papers() -> None:
    entries = chart(at(0, 0, 1, 1, 0), DriftRules(weight=0.25, learn=2))
    assert [entry.drift_mm for entry in entries] == pytest.approx([0, 0, 0.25, 0.25 + 0.75 * 0.25, 0.75 * 0.4375])


def test_the_limit_is_what_the_average_does_by_chance() -> None:
    """Beside the deviation of the average over many simulated charts, at the first point and after many."""
    rng, rules = np.random.default_rng(3), DriftRules(learn=5)
    averages = {number: [] for number in (5, 8, 40)}
    limits = dict.fromkeys(averages, 0.0)
    for _ in range(300):
        entries = chart(Cell(0.0).verifications(np.zeros(41), rng), rules)
        for number in averages:
            averages[number].append(entries[number].average_mm)
            limits[number] += entries[number].limit_mm / 300
    for number, found in averages.items():
        sigma = float(np.std(found))
        assert 3.0 < limits[number] / sigma < 5.2, (number, limits[number], sigma)


def test_a_step_does_not_hide_itself() -> None:
    """However large: the newest difference is not part of the noise it is judged by."""
    still = list(np.random.default_rng(1).normal(0, 0.03, 20))
    entries = chart(at(*still, 50.0), DriftRules(weight=0.1))
    assert entries[-2].standing == "steady"
    assert entries[-1].standing == "drifting"


def test_what_is_allowed_is_no_alarm() -> None:
    shifted = [0.0] * 5 + [0.3] * 40
    assert first_alarm(at(*shifted), DriftRules()) is not None
    assert first_alarm(at(*shifted), DriftRules(allowed_mm=0.3)) is None


def test_a_steady_cell_is_left_alone_for_at_least_as_long_as_asked() -> None:
    rules = DriftRules(runs_between_false_alarms=100)
    length, _ = steady(Cell(0.05), rules, cells=40, length=300, rng=np.random.default_rng(5))
    assert length > 100


@pytest.mark.parametrize(("drift", "median_at_most"), [(step(5 * OF_A_VERIFICATION_MM), 5), (ramp(0.02), 10)])
def test_a_drift_is_found_soon(drift: object, median_at_most: int) -> None:
    waited, _ = delays(Cell(0.05), DriftRules(), drift, cells=25, rng=np.random.default_rng(7))  # type: ignore[arg-type]
    assert np.median(waited) <= median_at_most


def test_the_centre_is_the_same_whichever_points_are_seen() -> None:
    """Also of a flat target, tilted, that is seen by half; the scatter is that of its centre."""
    rng = np.random.default_rng(2)
    base_T_target = BASE_T_TARGET @ transform(rotation_from_vector([0.3, -0.4, 2.0]), [5.0, 6, 7])
    true = map_points(base_T_target, MIDDLE[None])[0]
    for ids in (np.arange(88), np.arange(0, 44), rng.choice(88, 20, replace=False)):
        seen = map_points(base_T_target, BOARD.points_mm[ids])
        aside = np.array([[[0.0, 0, 0]], [[0.3, 0, 0]], [[-0.3, 0, 0]]])
        sample = sample_of(seen + aside, BOARD.points_mm[ids], MIDDLE)
        np.testing.assert_allclose(sample.centre_mm, true, atol=1e-9)
        assert sample.scatter_mm == pytest.approx(0.3 / 3**0.5)
        assert sample.positions == 3


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_scatter_explained_by_the_calibration_is_no_disagreement(seed: int) -> None:
    """X's error and the robot's noise together: by chance one in a thousand lies above; ten times as much always."""
    rng = np.random.default_rng(seed)
    limit = scatter_limit_mm(0.1 * 3**0.5, NOISE_MM * 3**0.5, 3, 1e-4)
    sample = Cell(0.1).verifications(np.zeros(1), rng)[0]
    assert sample.scatter_mm < 1.3 * limit
    assert limit == pytest.approx((0.1**2 + NOISE_MM**2) ** 0.5 * (27.86 / 6) ** 0.5, rel=1e-3)
