"""X of several sensors on one mount from one estimate: one target pose, one error of the robot's pose a station.

At a station where two sensors see the target the robot's error moves both by the same amount. Their poses relative to
each other are therefore known to the accuracy of the sensors, whatever the robot's; what one sensor says of the target
serves the other. Linearised; the levels of the noise are averaged as in `pose_pairs.noise_marginalisation`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.closed_forms.observability import require_observable
from calibration.errors import GeometryError
from calibration.linear_algebra import squared_distances
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.noise_marginalisation import draw_levels, step_at
from calibration.pose_pairs.noise_models import robot_sources
from calibration.pose_pairs.noise_priors import LEVEL_PRIORS, LevelPrior, NoisePrior
from calibration.pose_pairs.residuals import LinearisedPairs, ScaledChain, initial_chain, linearise
from calibration.problem import Problem, Setup
from calibration.solve import estimate_session
from calibration.transforms import (
    Array,
    adjoint,
    difference,
    inverse,
    nearest_rotation,
    transform,
    transform_from_vector,
    vector_from_transform,
)
from extensions.rigs.mathematics.sensor_views import POSE, SensorViews, imaging_sensor, measured_sensor

SAME_MM, SAME_RAD = 2e-3, 1e-5
"""Two records of one pose differ by no more: three decimals of a millimetre, and six of a quaternion."""

Stations = list[NDArray[np.intp]]
"""For each sensor the station (n,) of each of its views."""


def find_stations(sensors: Sequence[SensorViews]) -> Stations:
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


MAX_SENSORS = 4
ROUNDS = 4
"""Gauss-Newton steps from the closed form at usual levels of noise."""

UNKNOWN_ERRORS = (LEVEL_PRIORS["camera rotation"], LEVEL_PRIORS["camera lateral"])
ERRORS_BEYOND_KNOWN = (LevelPrior(float(np.radians(0.005))), LevelPrior(0.02))
"""Priors of a sensor's errors in rotation and in translation: of one whose covariance is not given, and beyond it."""

ROBOT_PRIORS = tuple(LEVEL_PRIORS[name] for name in ("robot rotation", "robot translation", "arm"))


@dataclass(frozen=True, eq=False)
class RigSolution:
    """The joint estimate of S sensors.

    mount_T_sensor : (S, 4, 4). anchor_T_target : (4, 4).
    covariance : (6 S + 6, 6 S + 6) of all of them, each of pose @ exp(.), [rotation rad, translation mm].
    robot : standard deviations of the robot's pose, rotation in rad and translation in mm.
    stations, shared : number of stations, and of those at which more than one sensor saw the target.
    """

    setup: Setup
    sensors: tuple[SensorViews, ...]
    mount_T_sensor: Array
    anchor_T_target: Array
    covariance: Array
    robot: tuple[float, float]
    stations: int
    shared: int

    def covariance_of(self, sensor: int) -> Array:
        """(6, 6) of mount_T_sensor[sensor] @ exp(.)."""
        rows = slice(POSE * sensor, POSE * (sensor + 1))
        return self.covariance[rows, rows]

    def relative(self, a: int, b: int) -> tuple[Array, Array]:
        """a_T_b (4, 4) of two sensors, and the covariance (6, 6) [rotation rad, translation mm] of a_T_b @ exp(.).

        X_a exp(u) and X_b exp(v) give exp(-u) a_T_b exp(v) = a_T_b exp(v - adjoint(b_T_a) u), to first order.
        """
        a_T_b = inverse(self.mount_T_sensor[a]) @ self.mount_T_sensor[b]
        columns = np.zeros((POSE, len(self.covariance)))
        columns[:, POSE * b : POSE * (b + 1)] = np.eye(POSE)
        columns[:, POSE * a : POSE * (a + 1)] = -adjoint(inverse(a_T_b))
        return a_T_b, columns @ self.covariance @ columns.T

    def disagreement(self, sensor: int, mount_T_sensor: Array, covariance: Array) -> float:
        """Probability that an X of this sensor alone, with its covariance (6, 6), is so far from the joint one."""
        off = vector_from_transform(inverse(self.mount_T_sensor[sensor]) @ mount_T_sensor)
        return float(scipy.special.chdtrc(POSE, squared_distances(off, covariance)))


@dataclass(frozen=True, eq=False)
class _Linear:
    """`noise_marginalisation.LinearModel` of stations with 6 S residuals; a sensor without a view there has zeros."""

    residuals: Array
    by_shared: Array
    floor: Array
    directions: list[Array]


def solve_rig(problems: Mapping[str, Problem]) -> RigSolution:
    """X of several sensors on one mount, each with its session of one target at one place, from one estimate.

    The sensor with most views gives the start. Raises UndeterminedError where a session of images, or all of them, do
    not determine X, GeometryError for one sensor or more than MAX_SENSORS, for sensors of different set-ups, and for a
    sensor without views.
    """
    sensors = []
    for name, problem in problems.items():
        if problem.in_space:
            sensors.append(measured_sensor(name, problem))
        else:
            estimate = estimate_session(problem)
            sensors.append(imaging_sensor(name, estimate.prepared, estimate.selection))
    if not 2 <= len(sensors) <= MAX_SENSORS:
        raise GeometryError(f"{len(sensors)} sensors: two to {MAX_SENSORS} are solved together")
    if len({sensor.pairs.setup for sensor in sensors}) > 1:
        raise GeometryError("sensors of different set-ups have no mount in common")
    for sensor in sensors:
        if not len(sensor.pairs):
            raise GeometryError(f"{sensor.name} has not seen the target in any picture")
    stations = find_stations(sensors)
    mounts, target = _start(sensors)
    own = [UNKNOWN_ERRORS if each.pairs.covariance is None else ERRORS_BEYOND_KNOWN for each in sensors]
    each = [*ROBOT_PRIORS, *(level for both in own for level in both)]  # none relative to another
    prior = NoisePrior(np.eye(len(each)), np.log([one.level for one in each]), np.log([one.factor for one in each]))
    known = _known(sensors)
    for _ in range(ROUNDS):
        linear = _linearise(sensors, stations, mounts, target)
        mounts, target = _moved(mounts, target, step_at(linear, linear.directions, prior.mean, known))
    linear = _linearise(sensors, stations, mounts, target)
    nodes = draw_levels(linear, linear.directions, prior, prior.mean, known)
    step, covariance = _with_known_lengths(sensors, *nodes.mean_step())
    mounts, target = _moved(mounts, target, step)
    levels = nodes.mean_levels()
    places = POSE * (len(sensors) + 1)
    _, times = np.unique(np.concatenate(stations), return_counts=True)
    return RigSolution(
        sensors[0].pairs.setup, tuple(sensors), mounts, target, covariance[:places, :places],
        (float(levels[0]), float(levels[1])), len(times), int(np.count_nonzero(times > 1)),
    )  # fmt: skip


def _with_known_lengths(sensors: Sequence[SensorViews], step: Array, covariance: Array) -> tuple[Array, Array]:
    """The step (p,) and its covariance (p, p) with the lengths of sensors in space averaged over what is known."""
    common = POSE * (len(sensors) + 1)
    for sensor in sensors:
        of = np.arange(common, common := common + len(sensor.gradient))
        if sensor.lengths is None:
            continue
        found, spread = step[of], covariance[np.ix_(of, of)]
        mean, after = sensor.lengths.after(found, spread, max(3 * len(sensor.pairs) - POSE - len(of), 1))
        slope = np.linalg.solve(spread, covariance[of]).T
        step, covariance = step + slope @ (mean - found), covariance + slope @ (after - spread) @ slope.T
    return step, covariance


def _moved(mounts: Array, target: Array, step: Array) -> tuple[Array, Array]:
    """X of the sensors and the target's pose after a step (p,), which begins with theirs."""
    poses = transform_from_vector(clip_step(step[: POSE * (len(mounts) + 1)]).reshape(-1, POSE))
    return mounts @ poses[:-1], target @ poses[-1]


def _start(sensors: Sequence[SensorViews]) -> tuple[Array, Array]:
    """X of every sensor (S, 4, 4) and the target's pose (4, 4); the target's from the sensor with most views."""
    first = max(sensors, key=lambda sensor: len(sensor.pairs))
    require_observable(first.pairs.base_T_flange)
    target = initial_chain(replace(first.pairs, length_sigmas=())).anchor_T_target
    mounts = []
    for sensor in sensors:
        seen = inverse(sensor.pairs.anchor_T_mount()) @ target @ inverse(sensor.pairs.camera_T_target)
        turn, _ = nearest_rotation(seen[:, :3, :3].mean(axis=0))
        mounts.append(transform(turn, seen[:, :3, 3].mean(axis=0)))
    return np.array(mounts), target


def _linearise(sensors: Sequence[SensorViews], stations: Stations, mounts: Array, target: Array) -> _Linear:
    count, rows = int(max(of.max() for of in stations)) + 1, POSE * len(sensors)
    unknowns = rows + POSE + sum(sensor.by_common.shape[2] for sensor in sensors)
    residuals, by_shared = np.zeros((count, rows)), np.zeros((count, rows, unknowns))
    floor = np.tile(np.eye(rows), (count, 1, 1))
    robot = [np.zeros((count, rows, 3)) for _ in ROBOT_PRIORS]
    own: list[Array] = []
    common = rows + POSE
    for number, (sensor, of) in enumerate(zip(sensors, stations, strict=True)):
        at: LinearisedPairs = linearise(sensor.pairs, ScaledChain(mounts[number], target))
        mine = slice(POSE * number, POSE * (number + 1))
        residuals[of, mine] = at.residuals
        by_shared[of, mine, mine] = at.by_shared[:, :, :POSE]
        by_shared[of, mine, rows : rows + POSE] = at.by_shared[:, :, POSE : 2 * POSE]
        own_unknowns = sensor.by_common if sensor.lengths is None else at.by_shared[:, :, 2 * POSE :]
        by_shared[of, mine, common : common + own_unknowns.shape[2]] = own_unknowns
        common += own_unknowns.shape[2]
        floor[of, mine, mine] = at.floor
        for directions, source in zip(robot, robot_sources(at).values(), strict=True):
            directions[of, mine] = source
        for start in (mine.start, mine.start + 3):  # its errors in rotation and in translation, of the target's origin
            own.append(np.zeros((count, rows, 3)))
            own[-1][of, start : start + 3] = np.eye(3)
    return _Linear(residuals, by_shared, floor, [*robot, *own])


def _known(sensors: Sequence[SensorViews]) -> Array:
    """(p, p + 1): what the pixels say of the cameras' intrinsics, as information and gradient."""
    unknowns = POSE * (len(sensors) + 1) + sum(len(sensor.gradient) for sensor in sensors)
    known, common = np.zeros((unknowns, unknowns + 1)), POSE * (len(sensors) + 1)
    for sensor in sensors:
        of = slice(common, common + len(sensor.gradient))
        known[of, of], known[of, -1] = sensor.information, sensor.gradient
        common = of.stop
    return known
