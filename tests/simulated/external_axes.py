"""Cells of an arm on a track, or with the target on a turntable, whose controller leaves the axis out of its poses."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.kinematics.external_axis import AxisKind, ExternalAxis
from calibration.problem import Problem, Setup
from calibration.transforms import Array, inverse
from tests.simulated.sessions import Cell, CellNoise, random_cell

READINGS = {"track": np.array([0.0, 1000.0, 2000.0]), "turntable": np.radians([0.0, 60.0, 150.0])}
DRAWN = {
    "track": ExternalAxis("track", 1, np.array([0.0, 1.0, 0.0]), np.zeros(3)),
    "turntable": ExternalAxis("turntable", 2, np.array([0.0, 0.0, 1.0]), np.array([1000.0, 0.0, 200.0])),
}
OFF_RAD, OFF_MM = float(np.radians(0.4)), 20.0
"""Of the axis as built from the one as drawn, one standard deviation a component."""


@dataclass(frozen=True, eq=False)
class AxisCell:
    """A cell whose truth is with the axis at its zero, the session as the controller reports it, the axis as built."""

    cell: Cell
    problem: Problem
    axis: ExternalAxis


def axis_cell(
    kind: AxisKind, seed: int, *, setup: Setup = "eye-in-hand", views: int = 12, zero: float = 0.0
) -> AxisCell:
    """Views spread over three positions of the axis; the session gives it as drawn."""
    rng = np.random.default_rng(seed)
    drawn = DRAWN[kind]
    built = drawn.apply_step(np.r_[OFF_RAD * rng.standard_normal(2), OFF_MM * rng.standard_normal(2)])
    cell = random_cell(rng, views, CellNoise(), setup=setup)
    readings = READINGS[kind][np.arange(views) % 3]
    reported = tuple(
        view.standing(base_T_flange=inverse(built.motion(at)) @ view.base_T_flange, external_axes=axes_at(drawn, at))
        for view, at in zip(cell.problem.views, readings, strict=True)
    )
    problem = replace(cell.problem, views=reported, external_axis=drawn, poses_from_controller=True)
    return AxisCell(cell, problem, built)


def axes_at(axis: ExternalAxis, reading: float) -> tuple[float | None, ...]:
    """What the controller reports of its axes, mm or degrees, with this one at a reading in mm or rad."""
    return (*[None] * (axis.number - 1), float(reading if axis.kind == "track" else np.degrees(reading)))


def direction_off_deg(one: Array, other: Array) -> float:
    """Angle between two directions (3,)."""
    return float(np.degrees(np.linalg.norm(np.cross(one, other))))
