"""How far off the answer to a damaged session is, in its own uncertainties."""

import numpy as np

from calibration.likelihood.predicted_uncertainty import working_points_mm
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.transforms import map_points
from tests.simulated.damage import DISTANCE_MM, DamagedSession


def excess(session: DamagedSession, solution: Solution) -> tuple[float, int]:
    """The RMS error of points by X over their standard deviation, of the truth that is nearest; which it is."""
    assert solution.mount_T_camera is not None and solution.uncertainty is not None and solution.camera is not None
    points_mm = working_points_mm(solution.camera, DISTANCE_MM)
    seen_mm = map_points(solution.mount_T_camera, points_mm)
    errors_mm = [
        float(np.sqrt(np.mean(np.sum((seen_mm - map_points(truth, points_mm)) ** 2, axis=1))))
        for truth in session.truths
    ]
    nearest = int(np.argmin(errors_mm))
    return errors_mm[nearest] / solution.uncertainty.point_mm, nearest


def intact_excess(session: DamagedSession, which: int) -> float:
    """`excess` of the undamaged views alone, over their own uncertainty; 0 where they have no X."""
    solution = solve_hand_eye(session.intact[which])
    return 0.0 if solution.mount_T_camera is None else excess(session, solution)[0]
