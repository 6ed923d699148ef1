"""Simulated sessions for tests, and ways to spoil them."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from calibration.problem import Detection, Problem, View
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, difference, rotation_from_vector, transform
from tests.simulated.sessions import Cell, CellNoise, random_cell

QUIET = CellNoise(0.0, 0.0, 0.0)
ORDINARY = CellNoise()


def cell(seed: int, views: int, noise: CellNoise = ORDINARY, **options: object) -> Cell:
    return random_cell(np.random.default_rng(seed), views, noise, **options)  # type: ignore[arg-type]


@cache
def solved_session() -> tuple[Problem, Solution]:
    """An ordinary session of ten views and its solution, for tests of what is said of a solution; not to be changed."""
    problem = cell(21, 10).problem
    return problem, solve_hand_eye(problem)


def with_view(problem: Problem, index: int, change: Callable[[View], View]) -> Problem:
    """The session with one view changed."""
    views = [change(view) if view.index == index else view for view in problem.views]
    return replace(problem, views=tuple(views))


def shifted(offset_mm: list[float]) -> Callable[[View], View]:
    return lambda view: view.standing(base_T_flange=transform(np.eye(3), offset_mm) @ view.base_T_flange)


def board_turned(view: View) -> View:
    """The detector numbered the corners from the other end."""
    assert view.detection is not None
    return replace(view, detection=Detection(view.detection.ids, view.detection.corners_px[::-1].copy()))


def with_corners(change: Callable[[Array], Array]) -> Callable[[View], View]:
    def changed(view: View) -> View:
        assert view.detection is not None
        corners = change(view.detection.corners_px.copy())
        return replace(view, detection=Detection(view.detection.ids[: len(corners)], corners))

    return changed


def turned(rotation_deg: list[float], translation_mm: list[float]) -> Array:
    return transform(rotation_from_vector(np.radians(rotation_deg)), translation_mm)


def error_of(mount_T_camera: Array | None, truth: Cell) -> tuple[float, float]:
    """mm and degrees."""
    assert mount_T_camera is not None
    translation_mm, rotation_rad = difference(truth.mount_T_camera, mount_T_camera)
    return translation_mm, float(np.degrees(rotation_rad))
