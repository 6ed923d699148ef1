"""The tip of a tool in the flange's frame, by turning the flange about a fixed point that the tip touches.

Pose i, with rotation R_i and translation t_i, puts the tip p at the fixed point c of the base:

    R_i p + t_i = c,      3 equations for the 6 unknowns p and c

solved by least squares with equal errors along all axes. The posterior covariance of a normal error of unknown size is
s² v / (v - 2) (A'A)^-1, with v = 3 n - 6 degrees of freedom (Gelman et al., Bayesian Data Analysis, 14.2): with few
poses it is larger than s² (A'A)^-1, so that U = 2 sigma still covers 95 %.

Outlying poses: one after the other the pose is left out whose omission reduces the sum of squares most, as its F ratio
measures; the outliers are those up to the last significant one (B. Rosner, "Percentage points for a generalized ESD
many-outlier procedure", Technometrics 25, 1983), so that two of them do not hide each other.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.documents.tip import TipDocument
from calibration.errors import GeometryError, UndeterminedError
from calibration.sentences.sentence import Sentence
from calibration.solution import COVERAGE_FACTOR
from calibration.transforms import Array

MIN_POSES = 4
"""Three determine the tip; with four an error shows."""

MIN_TURN = 0.1
"""Smallest effect of a tip's error, as a share of it, on where the poses put the tip; 0.1: tilts of about 8 degrees."""

FALSE_ALARM_PROBABILITY = 0.01
"""Probability that a session without outliers loses a pose."""

ROUNDING_MM = 1e-6
"""Residuals below it are rounding: they make no pose an outlier."""

MAX_COORDINATE_MM = 1e6

MAX_SCATTER_MM = 100.0
"""Poses that scatter more, per axis, do not touch one point."""

FLAT = 1e-9
"""Up to this the other poses leave the place of one undetermined: it cannot be judged."""


@dataclass(frozen=True, eq=False)
class TipCalibration:
    """The tip and the fixed point that it touched.

    flange_tip_mm, covariance : (3,) and (3, 3) in the flange's frame.
    base_point_mm : (3,).
    base_residuals_mm : (n, 3) where each pose puts the tip less the fixed point, for outliers too.
    used : (n,) False for outliers.
    sigma_mm : of one placing of the tip, per axis: the robot's and the operator's error together.
    """

    flange_tip_mm: Array
    covariance: Array
    base_point_mm: Array
    base_residuals_mm: Array
    used: NDArray[np.bool_]
    sigma_mm: float

    @property
    def point_sigma_mm(self) -> float:
        """Standard deviation of the tip over its three axes together."""
        return sqrt(float(np.trace(self.covariance)))

    @property
    def outliers(self) -> tuple[int, ...]:
        """The poses that were left out, from 0."""
        return tuple(int(index) for index in np.flatnonzero(~self.used))


def calibrate_tip(base_T_flange: Array) -> TipCalibration:
    """The tip from poses (n, 4, 4) in which it touches one fixed point.

    Raises UndeterminedError: "tip-too-few-poses" below MIN_POSES, "tip-turns-too-little" where the poses turn too
    little or about one axis only. Raises GeometryError for numbers that are
    not finite or beyond MAX_COORDINATE_MM, and a scatter beyond MAX_SCATTER_MM.
    """
    poses = np.asarray(base_T_flange, float)
    if not np.all(np.abs(poses) <= MAX_COORDINATE_MM):
        raise GeometryError("a pose has a number that is not finite, or is further away than 1 km")
    if len(poses) < MIN_POSES:
        raise UndeterminedError(
            "tip-too-few-poses",
            Sentence("tip-few-poses", poses=len(poses)),
            Sentence("give-tip-poses", least=MIN_POSES),
        )
    _require_turns(poses[:, :3, :3])
    used = np.ones(len(poses), bool)
    used[_outliers(poses)] = False
    fit = _Fit.of(poses[used])
    dof = fit.degrees_of_freedom
    variance = fit.sum_of_squares / dof
    if sqrt(variance) > MAX_SCATTER_MM:
        raise GeometryError(
            f"the poses put the tip at places that scatter by {sqrt(variance):.0f} mm: touch one fixed point in all of"
            " them, and check convention and unit"
        )
    residuals = poses[:, :3, :3] @ fit.unknowns[:3] + poses[:, :3, 3] - fit.unknowns[3:]
    return TipCalibration(
        fit.unknowns[:3], variance * dof / (dof - 2) * fit.cofactors[:3, :3], fit.unknowns[3:], residuals, used,
        sqrt(variance),
    )  # fmt: skip


def _turns(rotations: Array) -> tuple[Array, Array]:
    """Ascending effects (3,) of a tip's error of 1 along directions (columns, (3, 3)), RMS over the poses."""
    mean = rotations.mean(axis=0)
    # The mean square of (R_i - mean) v is v'(1 - mean' mean) v.
    squares, directions = np.linalg.eigh(np.eye(3) - mean.T @ mean)
    return np.sqrt(np.maximum(squares, 0.0)), directions


def _require_turns(rotations: Array) -> None:
    effects, directions = _turns(rotations)
    if effects[0] < MIN_TURN:
        along = ", ".join(f"{value:+.2f}" for value in directions[:, 0])
        raise UndeterminedError(
            "tip-turns-too-little", Sentence("tip-unturned", along=along), Sentence("turn-about-tip")
        )


@dataclass(frozen=True, eq=False)
class _Fit:
    """Least squares of poses: unknowns (6,) [tip in the flange, point in the base], cofactors (6, 6) = (A'A)^-1.

    omissions : (n,) by how much the sum of squares falls without each pose; 0 where the others leave it undetermined.
    """

    unknowns: Array
    cofactors: Array
    sum_of_squares: float
    degrees_of_freedom: int
    omissions: Array

    @classmethod
    def of(cls, poses: Array) -> "_Fit":
        n = len(poses)
        rows = np.concatenate([poses[:, :3, :3], -np.broadcast_to(np.eye(3), (n, 3, 3))], axis=2)
        cofactors = np.linalg.inv(np.einsum("nij,nik->jk", rows, rows))
        # Translations are reduced by their mean, so that a base far away costs no digits.
        origin = poses[:, :3, 3].mean(axis=0)
        unknowns = cofactors @ np.einsum("nij,ni->j", rows, origin - poses[:, :3, 3])
        off = rows @ unknowns + poses[:, :3, 3] - origin
        unknowns[3:] += origin
        left = np.eye(3) - rows @ cofactors @ np.swapaxes(rows, 1, 2)
        judged = np.linalg.eigvalsh(left)[:, 0] > FLAT
        solved = np.linalg.solve(np.where(judged[:, None, None], left, np.eye(3)), off[..., None])[..., 0]
        omissions = np.where(judged, np.sum(off * solved, axis=1), 0.0)
        return cls(unknowns, cofactors, float(np.sum(off * off)), 3 * n - 6, omissions)


def _outliers(poses: Array) -> list[int]:
    """Generalized extreme Studentized deviates over whole poses; at most a third, and MIN_POSES remain."""
    kept = list(range(len(poses)))
    removed: list[int] = []
    outlying = 0
    for _ in range(min(len(poses) // 3, len(poses) - MIN_POSES)):
        fit = _Fit.of(poses[kept])
        worst = int(np.argmax(fit.omissions))
        dof = fit.degrees_of_freedom - 3
        rest = max(fit.sum_of_squares - float(fit.omissions[worst]), dof * ROUNDING_MM**2)
        ratio = float(fit.omissions[worst]) / 3 / (rest / dof)
        significant = float(scipy.special.fdtrc(3, dof, ratio)) * len(kept) < FALSE_ALARM_PROBABILITY
        removed.append(kept.pop(worst))
        if _turns(poses[kept, :3, :3])[0][0] < MIN_TURN:
            break
        outlying = len(removed) if significant else outlying
    return removed[:outlying]


def tip_document(found: TipCalibration, names: tuple[str, ...]) -> TipDocument:
    """The tip.json of a calibrated tip; `names` of the poses."""
    return TipDocument.model_validate(
        {
            "flange_tip_mm": found.flange_tip_mm.tolist(),
            "covariance": found.covariance.tolist(),
            "placing_sigma_mm": found.sigma_mm,
            "expanded_mm": COVERAGE_FACTOR * found.point_sigma_mm,
            "base_point_mm": found.base_point_mm.tolist(),
            "poses": [
                {"name": name, "used": bool(used), "base_residual_mm": off.tolist()}
                for name, used, off in zip(names, found.used, found.base_residuals_mm, strict=True)
            ],
        }
    )


def tip_text(tip: TipDocument) -> str:
    """A calibrated tip in a few lines."""
    x, y, z = tip.flange_tip_mm
    used = sum(pose.used for pose in tip.poses)
    lines = [
        f"tip at ({x:.3f}, {y:.3f}, {z:.3f}) mm on the flange, U = {tip.expanded_mm or 0:.3f} mm (k = 2)",
        f"  {used} of {len(tip.poses)} poses used; one placing errs by {tip.placing_sigma_mm:.3f} mm per axis",
    ]
    for pose in tip.poses:
        length_mm = float(np.linalg.norm(pose.base_residual_mm))
        lines.append(f"  pose {pose.name:<12} {length_mm:.3f} mm{'' if pose.used else '  left out: an outlier'}")
    return "\n".join(lines)
