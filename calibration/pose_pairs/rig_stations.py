"""The stations of a rig: at each the robot stood once, and one sensor or several saw the target."""

import numpy as np
from numpy.typing import NDArray

from calibration.pose_pairs.sensor_views import SensorViews
from calibration.transforms import Array, difference

SAME_MM, SAME_RAD = 2e-3, 1e-5
"""Two records of one pose differ by no more: three decimals of a millimetre, and six of a quaternion."""

Stations = list[NDArray[np.intp]]
"""For each sensor the station (n,) of each of its views."""


def find_stations(sensors: list[SensorViews]) -> Stations:
    """Stations numbered from 0. Views of two sensors belong to one when the robot's recorded pose is the same."""
    poses: list[Array] = []
    found: Stations = []
    for sensor in sensors:
        rows = [_station(pose, poses) for pose in sensor.pairs.base_T_flange]
        for view, station in enumerate(rows):
            if station is None or station in rows[:view]:
                rows[view] = len(poses)
                poses.append(sensor.pairs.base_T_flange[view])
        found.append(np.array(rows, np.intp))
    return found


def _station(pose: Array, poses: list[Array]) -> int | None:
    for station, known in enumerate(poses):
        apart_mm, apart_rad = difference(known, pose)
        if apart_mm < SAME_MM and apart_rad < SAME_RAD:
            return station
    return None


def shared_stations(stations: Stations) -> int:
    """Number of stations at which more than one sensor saw the target."""
    _, times = np.unique(np.concatenate(stations), return_counts=True)
    return int(np.count_nonzero(times > 1))
