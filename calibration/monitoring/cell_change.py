"""What changed in a cell between verifications: the camera, the target, or the zero of one of the arm's axes.

At each station the same target is seen again. What is constant at a station (errors of X and of the arm) cancels in the
difference of the flange's pose relative to the target, as computed then and now; r (6,) is that difference as a motion
of the flange, flange @ exp(r):

    zero of axis k turned    r = the axis's motion, seen from the flange, times the angle
    camera moved             r = one motion for all stations, in the frame of the camera's mount
    target moved             r = one motion for all stations, in the frame in which the target stands

The hypotheses are compared by their evidence, with amounts normal about zero at several scales and the noise at several
levels, both averaged over. A turned axis 1 is also a target turned about it, and axis 6 also a camera turned about it:
the hypothesis with fewer unknowns is the likelier one where it explains the same.
Source: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees
from typing import Literal

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import AXES
from calibration.likelihood.chain import Chain
from calibration.likelihood.mixed_model import linearise_model
from calibration.likelihood.predicted_uncertainty import Scene, observe_whole_target
from calibration.linear_algebra import inverse_or_pseudo_inverse
from calibration.observations.reprojection import pixel_statistics
from calibration.transforms import Array, adjoint, inverse, nearest_rotation, transform, vector_from_transform

Cause = Literal["nothing", "camera-moved", "target-moved", "axis-zero"]

SAME_STATION_RAD = float(np.radians(0.5))
"""Largest difference of a joint at which two views are of one station."""

MIN_STATIONS = 2

MAX_BEFORE = 5
"""Verifications with which the newest one is compared."""

PRIOR_NOTHING = 0.9
"""That nothing changed since the last verification; camera, target and arm share the rest, the axes the arm's third."""

SCALES_MM = (0.1, 0.4, 1.6, 6.4)
"""Prior deviations of a motion; of a rotation the same at LEVER_MM."""

LEVER_MM = 1000.0

NOISE_LEVELS = 2.0 ** np.arange(-2.0, 4.5, 0.5)
"""Of the noise, in units of what is expected; log-normal about 1 with a factor of 2."""

STEP_RAD = 1e-6


@dataclass(frozen=True, eq=False)
class SeenTarget:
    """A verification's n stations: joints (n, 6), poses of the flange (n, 4, 4) and of the target in its anchor."""

    joints_rad: Array
    base_T_flange: Array
    anchor_T_target: Array


@dataclass(frozen=True)
class DriftChangeDocument:
    """What may have changed between the chart's first verifications and the last one, with its probability.

    `cause` "axis-zero": the zero of `axis` (1 to 6) moved by `turned_deg`. Otherwise the camera or the target moved by
    `shift_mm` and `turn_deg`: the camera in the frame of its mount, the target in that in which it stands.
    """

    cause: Cause
    chance: float
    axis: int | None = None
    turned_deg: float | None = None
    shift_mm: tuple[float, float, float] | None = None
    turn_deg: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class _Hypothesis:
    """`by` (6 n, k): the stations' motions by the amounts, whose prior deviations are `sigmas` (k,) per mm of scale."""

    cause: Cause
    prior: float
    by: Array
    sigmas: Array
    axis: int | None = None


def fit_poses(target_mm: Array, anchor_mm: Array) -> Array:
    """anchor_T_target (n, 4, 4) with points (k, 3) of the target at (n, k, 3); Kabsch's rotation."""
    middle, poses = target_mm.mean(axis=0), []
    for seen in anchor_mm:
        rotation, _ = nearest_rotation((seen - seen.mean(axis=0)).T @ (target_mm - middle))
        poses.append(transform(rotation, seen.mean(axis=0) - rotation @ middle))
    return np.array(poses)


def find_change(before: Sequence[SeenTarget], now: SeenTarget, arm: Arm, scene: Scene) -> list[DriftChangeDocument]:
    """The possible changes between the verifications `before` and the one `now`, the likeliest first.

    `scene.noise`: repeatability of the arm and noise of the pixels. Verifications at other stations, or at the same
    poses in other postures, are not compared; empty where fewer than MIN_STATIONS are left.
    """
    same = [(one, _same_stations(one, now)) for one in before]
    most = max((len(stations) for _, stations in same), default=0)
    alike = [(one, stations) for one, stations in same if len(stations) == most][-MAX_BEFORE:]
    shared = [row for row in range(len(now.joints_rad)) if all(row in stations for _, stations in alike)]
    if most < MIN_STATIONS or len(shared) < MIN_STATIONS:
        return []
    motions = np.array(
        [_motions(scene, one, now, [stations[row] for row in shared], shared) for one, stations in alike]
    )  # (m, n, 6)
    noise = _pose_noise(scene, now.base_T_flange[shared])
    mean, m = motions.mean(axis=0), len(motions)
    spread = motions - mean
    quadratic = float(np.einsum("mni,nij,mnj->", spread, np.linalg.inv(noise), spread))
    dof = 6 * len(shared) * (m - 1)
    levels = -0.5 * np.log2(NOISE_LEVELS) ** 2 - dof * np.log(NOISE_LEVELS) - quadratic / (2 * NOISE_LEVELS**2)
    whole = np.zeros((6 * len(shared), 6 * len(shared)))
    for row, block in enumerate(noise):
        whole[6 * row : 6 * row + 6, 6 * row : 6 * row + 6] = block * (1 + 1 / m)
    hypotheses = _hypotheses(scene, arm, now.joints_rad[shared], now.base_T_flange[shared])
    found = [_evidence(one, mean.ravel(), whole, levels) for one in hypotheses]
    logs = np.array([np.log(one.prior) + log for one, (log, _) in zip(hypotheses, found, strict=True)])
    chances = np.exp(logs - logs.max())
    chances /= chances.sum()
    likeliest_first = np.argsort(-chances, kind="stable")
    return [_change(hypotheses[row], float(chances[row]), found[row][1]) for row in likeliest_first]


def _same_stations(before: SeenTarget, now: SeenTarget) -> dict[int, int]:
    """Rows of `before` by the row of the same station in `now`."""
    apart = np.abs(now.joints_rad[:, None] - before.joints_rad).max(axis=2)
    nearest = apart.argmin(axis=1)
    return {row: int(at) for row, at in enumerate(nearest) if apart[row, at] < SAME_STATION_RAD}


def _motions(scene: Scene, before: SeenTarget, now: SeenTarget, then: list[int], here: list[int]) -> Array:
    """Motions (n, 6) of the flange that explain the difference, rows `then` of before and `here` of now."""
    one, other = before.anchor_T_target[then], now.anchor_T_target[here]
    if scene.setup == "eye-in-hand":
        seen, again = inverse(before.base_T_flange[then]) @ one, inverse(now.base_T_flange[here]) @ other
        return vector_from_transform(seen @ inverse(again))
    return vector_from_transform(other @ inverse(one))


def _pose_noise(scene: Scene, base_T_flange: Array) -> Array:
    """Covariances (n, 6, 6) of a motion of the flange from one view, by the pixels and the arm's repeatability."""
    n = len(base_T_flange)
    chain = Chain(scene.setup, base_T_flange, scene.mount_T_camera, scene.anchor_T_target, np.zeros((n, 6)))
    seen, levels = chain.camera_T_target(), scene.noise.variances()
    statistics = pixel_statistics(observe_whole_target(scene, base_T_flange), scene.camera, seen, free_intrinsics=False)
    by_pixels = levels.pixel * inverse_or_pseudo_inverse(linearise_model(statistics, chain, seen).UU)
    return np.asarray(by_pixels + np.diag(levels.deviations() ** 2))


def _hypotheses(scene: Scene, arm: Arm, joints_rad: Array, base_T_flange: Array) -> list[_Hypothesis]:
    n, third = len(joints_rad), (1 - PRIOR_NOTHING) / 3
    on_flange = np.tile(np.eye(6), (n, 1))
    in_base = adjoint(inverse(base_T_flange)).reshape(6 * n, 6)
    by_camera, by_target = (on_flange, -in_base) if scene.setup == "eye-in-hand" else (in_base, on_flange)
    motion = np.repeat([1 / LEVER_MM, 1.0], 3)
    found = [
        _Hypothesis("nothing", PRIOR_NOTHING, np.zeros((6 * n, 0)), np.zeros(0)),
        _Hypothesis("camera-moved", third, by_camera, motion),
        _Hypothesis("target-moved", third, by_target, motion),
    ]
    drawn = inverse(arm.forward(joints_rad))
    for axis in range(AXES):
        turned = arm.forward(joints_rad + STEP_RAD * np.eye(AXES)[axis])
        by_axis = vector_from_transform(drawn @ turned).reshape(6 * n, 1) / STEP_RAD
        found.append(_Hypothesis("axis-zero", third / AXES, by_axis, motion[:1], axis + 1))
    return found


def _evidence(one: _Hypothesis, motions: Array, noise: Array, log_levels: Array) -> tuple[float, Array]:
    """Log-evidence up to a constant, and the amounts (k,) at the likeliest scale and noise."""
    logs, amounts = [], []
    for scale in SCALES_MM:
        spread = one.by * one.sigmas * scale
        for level, log_level in zip(NOISE_LEVELS, log_levels, strict=True):
            covariance = level**2 * noise + spread @ spread.T
            weighed = np.linalg.solve(covariance, motions)
            logs.append(log_level - 0.5 * (float(motions @ weighed) + float(np.linalg.slogdet(covariance)[1])))
            amounts.append(one.sigmas * scale * (spread.T @ weighed))
    best = int(np.argmax(logs))
    return float(logs[best] + np.log(np.mean(np.exp(np.array(logs) - logs[best])))), amounts[best]


def _change(one: _Hypothesis, chance: float, amount: Array) -> DriftChangeDocument:
    """Rounded to 1 nm and 1e-6 degrees."""
    change = DriftChangeDocument(one.cause, round(chance, 6), one.axis)
    if one.cause == "nothing":
        return change
    if one.axis is not None:
        return replace(change, turned_deg=round(degrees(amount[0]), 6))
    (a, b, c), (x, y, z) = np.degrees(amount[:3]).round(6).tolist(), amount[3:].round(6).tolist()
    return replace(change, shift_mm=(x, y, z), turn_deg=(a, b, c))
