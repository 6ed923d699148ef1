"""The direction of a track, or the axis of a turntable, found from the views together with X and the target's pose.

`find_axis` fits X, the target's pose and the axis to the target's pose in each view (least squares, robust). From there
`fit_axis` takes a step of the whole likelihood, over the corners, X, the target's pose and the axis, with the axis as
further shared unknowns of the linearised model; it is repeated until the step is small. The covariance of X and axis
together is that model's. Approximated: what X's covariance is widened by for errors beyond the model (of the target,
the lens, a trend) is added to X alone.
"""

from dataclasses import dataclass, replace

import numpy as np

from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.errors import UndeterminedError
from calibration.kinematics.external_axis import AxisKind, ExternalAxis
from calibration.likelihood.estimate import exact_pixels, linearise
from calibration.likelihood.mapped_points import point_rows
from calibration.likelihood.mixed_model import MixedModel, with_arm, with_trend
from calibration.likelihood.noise_marginalisation import marginalise
from calibration.likelihood.variance_components import estimate_variances
from calibration.preprocessing.prepare import PreparedSession, prepare
from calibration.problem import Problem, Setup, anchor_T_mount_of
from calibration.sentences.sentence import Sentence
from calibration.solution import ExternalAxisEstimate, Solution, Uncertainty
from calibration.solver.view_outliers import Selection
from calibration.transforms import Array, inverse, map_points, transform_from_vector, vector_from_transform

SAME_READING: dict[AxisKind, float] = {"track": 5.0, "turntable": float(np.radians(0.5))}
"""mm, rad: readings within it of each other are one position."""

LEVER_MM = 500.0
"""Of the first fit: an error of the target's orientation in a view counts as that of a place this far away."""

SETTLED_SIGMA = 0.05
"""A step of the axis below this many standard deviations is the last."""

START = "kronecker"
"""Closed form of X from which the first fit starts."""


def require_positions(axis: ExternalAxis, readings: Array) -> None:
    """Raises UndeterminedError `axis-not-moved` for readings (n,) of one position only."""
    if np.ptp(readings) <= SAME_READING[axis.kind]:
        raise UndeterminedError(
            "axis-not-moved",
            Sentence(f"{axis.kind}-not-moved", views=len(readings)),
            Sentence(f"move-the-{axis.kind}"),
        )


def readings_of(problem: Problem) -> Array:
    """Readings (n,) of all views."""
    assert problem.external_axis is not None
    found = [problem.external_axis.reading(view.stance.external_axes) for view in problem.views]
    return np.array([np.nan if reading is None else reading for reading in found])


def find_axis(problem: Problem, axis: ExternalAxis) -> ExternalAxis:
    """The axis by the target's pose in each view, from `axis`, which may point the other way. Raises UndeterminedError.

    It starts from the direction within some degrees, and a turntable's point within some centimetres.
    """
    found = [_fit_poses(problem, start) for start in (axis, replace(axis, direction=-axis.direction))]
    return min(found, key=lambda fit: fit[0])[1]


def _fit_poses(problem: Problem, axis: ExternalAxis) -> tuple[float, ExternalAxis]:
    """The cost and the axis of the least squares that start from `axis`."""
    import scipy  # for such sessions only

    rows = prepare(problem.with_axis_at_zero(axis))
    readings = readings_of(problem)[rows.seen.positions]
    require_positions(axis, readings)
    reported = inverse(axis.motion(readings)) @ rows.seen.base_T_flange
    first_X = CLOSED_FORMS[START](rows.anchor_T_mount, rows.camera_T_target)
    seen = rows.anchor_T_mount @ first_X @ rows.camera_T_target
    first_target = seen[np.argsort(np.linalg.norm(seen[:, :3, 3] - np.median(seen[:, :3, 3], axis=0), axis=1))[0]]
    weights = np.repeat([LEVER_MM, 1.0], 3)

    def residuals(unknowns: Array) -> Array:
        X, target = first_X @ transform_from_vector(unknowns[:6]), first_target @ transform_from_vector(unknowns[6:12])
        at_zero = axis.apply_step(unknowns[12:]).at_zero(reported, readings)
        anchor_T_target = anchor_T_mount_of(problem.setup, at_zero) @ X @ rows.camera_T_target
        return np.asarray((vector_from_transform(inverse(target) @ anchor_T_target) * weights).ravel())

    scale = np.r_[np.repeat([1 / LEVER_MM, 1.0], 3), np.repeat([1 / LEVER_MM, 1.0], 3), [1e-3, 1e-3, 1.0, 1.0]]
    fit = scipy.optimize.least_squares(
        residuals, np.zeros(12 + axis.unknowns), loss="soft_l1", x_scale=scale[: 12 + axis.unknowns]
    )
    return float(fit.cost), axis.apply_step(fit.x[12:])


@dataclass(frozen=True, eq=False)
class AxisFit:
    """A joint step of X, the target's pose and the axis.

    axis : after the step. settled : whether the step was small.
    widening : (12, 12) what the unknown axis adds to the covariance of X and the target's pose.
    covariance : (6 + k, 6 + k) of X @ exp(.) and the axis's unknowns.
    readings : (n,) of the views that are used, whose reported poses are `reported` (n, 4, 4).
    """

    axis: ExternalAxis
    settled: bool
    widening: Array
    covariance: Array
    readings: Array
    reported: Array

    def estimate(self, given: ExternalAxis, solution: Solution) -> ExternalAxisEstimate | None:
        """The axis beside the X of `solution`, whose covariance it takes over; None without X."""
        if solution.mount_T_camera is None or solution.uncertainty is None:
            return None
        inflation = 1.0 if solution.leave_out is None else solution.leave_out.inflation
        together = inflation * self.covariance
        together[:6, :6] = solution.uncertainty.covariance
        by = np.zeros((12, len(together)))
        by[:6, :6], by[6:, 6:] = np.eye(6), self.axis.by_vectors()
        cosine = float(np.clip(self.axis.direction @ given.direction, -1.0, 1.0))
        return ExternalAxisEstimate(
            axis=self.axis,
            covariance=by @ together @ by.T,
            readings=(float(self.readings.min()), float(self.readings.max())),
            sigma_mm=self._largest_sigma_mm(together, solution.setup, solution.mount_T_camera, solution.uncertainty),
            off_rad=float(np.arccos(cosine)),
        )

    def _largest_sigma_mm(self, together: Array, setup: Setup, X: Array, uncertainty: Uncertainty) -> float:
        """As in ExternalAxisEstimate; a camera that stands in the base registers without the axis."""
        if setup == "eye-to-hand":
            return uncertainty.worst_point.sigma_mm
        points_mm = np.array([point.camera_mm for point in uncertainty.points])
        at_zero = self.axis.at_zero(self.reported, self.readings)
        by_axis = self.axis.jacobian(at_zero, self.readings)
        by_x = np.broadcast_to(X[:3, :3] @ point_rows(points_mm), (len(at_zero), len(points_mm), 3, 6))
        rows = np.concatenate([by_x, point_rows(map_points(X, points_mm)) @ by_axis[:, None]], axis=-1)
        return float(np.sqrt(np.einsum("npij,jk,npik->np", rows, together, rows).max()))


def fit_axis(axis: ExternalAxis, readings: Array, prepared: PreparedSession, selection: Selection) -> AxisFit:
    """One step from the estimate with the axis held; `readings` (n,) of the prepared views."""
    best, rows, at = selection.best, prepared.take(selection.used), readings[selection.used]
    require_positions(axis, at)
    assert best.nuisances is not None
    held = linearise(exact_pixels(rows.seen, best.nuisances), best.chain, best.nuisances, best.z)
    at_zero, zeros = rows.seen.base_T_flange, np.zeros(axis.unknowns)

    def with_errors(model: MixedModel) -> MixedModel:
        return with_trend(model, best.model.basis) if best.model.trend_terms else model

    first = marginalise(with_errors(held), best.variances, prepared.belief)
    model = with_errors(with_arm(held, axis.jacobian(at_zero, at), zeros, zeros))
    whole = marginalise(model, estimate_variances(model, best.variances), prepared.belief)
    own = held.unknowns + np.arange(axis.unknowns)
    step, spread = whole.b[own], whole.covariance[np.ix_(own, own)]
    together = np.r_[np.arange(6), own]
    return AxisFit(
        axis=axis.apply_step(step),
        settled=bool(step @ np.linalg.solve(spread, step) < SETTLED_SIGMA**2 * len(step)),
        widening=whole.covariance[:12, :12] - first.covariance[:12, :12],
        covariance=whole.covariance[np.ix_(together, together)],
        readings=at,
        reported=inverse(axis.motion(at)) @ at_zero,
    )
