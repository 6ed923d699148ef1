"""Sessions whose camera warms up: the picture shifts on its sensor from view to view."""

from dataclasses import replace

import numpy as np

from calibration.problem import Detection, Problem

COLD_C, RISE_K = 32.0, 15.0
DIRECTION = np.array([0.6, -0.8])
"""Of the shift in the picture."""

VIEWS_TO_WARM = 1 / 3
"""Part of the session after which 63 % of the way would be done."""


def warmed(problem: Problem, shift_px: float, *, reported: bool = True) -> Problem:
    """The session with its picture shifted by `shift_px` at the end; `reported`: the views hold the temperature."""
    way = 1 - np.exp(-np.linspace(0.0, 1.0, len(problem.views)) / VIEWS_TO_WARM)
    views = []
    for view, part in zip(problem.views, way / way[-1], strict=True):
        assert view.detection is not None
        detection = Detection(view.detection.ids, view.detection.corners_px + shift_px * part * DIRECTION)
        temperature_c = COLD_C + RISE_K * float(part) if reported else None
        views.append(replace(view, detection=detection, camera_temperature_c=temperature_c))
    return replace(problem, views=tuple(views))
