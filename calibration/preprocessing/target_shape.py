"""Estimation of the target's true shape, which may differ from the description by printing errors and bending.

Residuals of a point that agree over many views come from the target, not from noise. Then every point gets an offset,
with two unknown standard deviations (in the plane and out of it) estimated as variance components, together with the
views' poses and, where free, the intrinsics: a self-calibrating bundle adjustment from the pixels alone (D. Brown,
"The bundle adjustment - progress and prospects", 1976). The prior of the offsets also fixes what pixels do not
determine: position, orientation and size of the target stay as described, in the mean.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.likelihood.distributions import f_quantile
from calibration.linear_algebra import (
    MIN_DETERMINED,
    covariance_of,
    scaled_inverse,
    scaled_pseudo_inverse,
    unit_diagonal,
)
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS, pixel_columns, with_intrinsics
from calibration.observations.view_poses import apply_pose_steps
from calibration.transforms import Array

MIN_VIEWS = 6
"""Least views that determine the points of the target each for itself."""

MAX_POINTS = 600
"""Most points; with more, the dense system over all points takes seconds."""

MANY_POINTS = 200
"""From here on the dense inverse costs more than the others do together."""

MAX_TEST_VIEWS = 30
MIN_TEST_SIGMA = 8.0
"""Threshold of the score test, in its standard deviations under an exact target."""

SHOWN_BY_CHANCE = 1e-3
"""Probability of taking straight lines for bent ones, and the lens as described for one that is not."""

P1_P2 = (6, 7)
"""Places of tangential distortion among fx fy cx cy k1 k2 p1 p2 k3."""

MIN_VARIANCE = 1e-12
"""px²: of exact corners."""

ITERATIONS = 12
STEP_TOLERANCE = 3e-3


@dataclass(frozen=True, eq=False)
class ShapeFit:
    """The target's points (k, 3), and the poses (n, 4, 4) and camera that fit them."""

    points_mm: Array
    camera: CameraModel
    camera_T_target: Array


@dataclass(frozen=True)
class Shown:
    """What images show beyond what is unknown anyway: deviations of each point, bent lines, tangential distortion."""

    points: bool = False
    bends: bool = False
    tangential: bool = False


def find_deviations(
    seen: Observations,
    camera: CameraModel,
    camera_T_target: Array,
    free: NDArray[np.bool_],
    shapes: Array,
    usual: int,
    *,
    tangential: bool,
) -> Shown:
    """Which residuals agree over views by more than noise explains; `tangential`: whether its distortion is asked for.

    `shapes` (k, 3, s): what one unit of each shape adds to the points; the first `usual` ones are unknown anyway, the
    others are bends. Bends and tangential distortion are each shown by what they explain beside the other, or alone
    where neither explains anything beside the other. Few views show no single points.
    Score tests at the described points. With g the gradient by the offsets and S its information once poses and
    intrinsics are free, g' diag(S)^-1 g has the mean s² tr(...) and variance 2 s⁴ |...|² under a perfect target; with P
    the shapes P'g has the information P'S P.
    """
    k, count = int(seen.ids.max(initial=0)) + 1, shapes.shape[-1]
    if k > MAX_POINTS:
        return Shown()
    rows = np.unique(np.linspace(0, len(seen) - 1, MAX_TEST_VIEWS).astype(np.intp))
    few, poses = seen.take(rows), camera_T_target[rows]
    lenses = (free, free | (tangential & np.isin(np.arange(len(free)), P1_P2)))
    system, whole = (_system(few, camera, poses, lens, k) for lens in lenses)
    drawn, bent = ([one.left(shapes[:k, :, :some]) for one in (system, whole)] for some in (usual, count))

    def shows(left: float, least: float, unknowns: int) -> bool:
        """Whether so many more unknowns lower the sum of squares from `left` to `least` by more than noise does."""
        freedom = whole.redundancy - count
        ratio = (left - least) / unknowns / (least / max(freedom, 1.0))
        return freedom >= 1 and bool(ratio > f_quantile(unknowns, freedom, SHOWN_BY_CHANCE))

    by_bends, by_lens = count - usual, len(P1_P2)
    bends, lens = shows(drawn[1], bent[1], by_bends), tangential and shows(bent[0], bent[1], by_lens)
    if not bends and not lens:
        bends, lens = shows(drawn[0], bent[0], by_bends), tangential and shows(drawn[0], drawn[1], by_lens)
    return Shown(len(seen) >= MIN_VIEWS and _points_deviate(system), bends, lens)


def _points_deviate(system: "_System") -> bool:
    information = system.information()
    correlation, scale = unit_diagonal(information)
    unseen = np.diagonal(information) < 1e-9 * np.diagonal(information).max()
    scale[unseen], correlation[unseen], correlation[:, unseen] = 0.0, 0.0, 0.0
    statistic = np.sum((scale * system.gradient) ** 2) / system.variance
    return bool(statistic - np.trace(correlation) > MIN_TEST_SIGMA * np.sqrt(2 * np.sum(correlation**2)))


def estimate_shape(
    seen: Observations, camera: CameraModel, camera_T_target: Array, free: NDArray[np.bool_], drawn_mm: Array
) -> ShapeFit:
    """The target's points from all views, with a prior about the described points `drawn_mm` (k, 3)."""
    offsets = np.zeros(drawn_mm.shape)
    levels = np.array([0.1, 0.1]) ** 2
    poses, now = camera_T_target, seen
    for _ in range(ITERATIONS):
        system = _system(now, camera, poses, free, len(drawn_mm))
        step, variances = system.step(offsets, system.variance / levels[[0, 0, 1]])
        offsets = offsets + step.reshape(-1, 3)
        # Foerstner's update of the variances (2,) mm², in the plane and out of it: squares over their redundancy.
        squares = np.array([np.sum(offsets[:, :2] ** 2), np.sum(offsets[:, 2] ** 2)])
        counts = np.array([2.0, 1.0]) * len(offsets)
        spent = np.array([np.sum(variances[:, :2]), np.sum(variances[:, 2])]) / levels
        levels = np.maximum(squares / np.maximum(counts - spent, 1e-3 * counts), 1e-8)
        pose_steps, camera_step = system.back_substitute(step)
        poses = apply_pose_steps(poses, pose_steps)
        change = np.zeros(INTRINSICS)
        change[free] = camera_step
        camera = with_intrinsics(camera, change)
        now = replace(seen, points_mm=seen.points_mm + offsets[seen.ids])
        if np.sqrt(np.mean(step**2)) < STEP_TOLERANCE * np.sqrt(np.mean(offsets**2)):
            break
    return ShapeFit(drawn_mm + offsets, camera, poses)


@dataclass(frozen=True, eq=False)
class _System:
    """Normal equations of the offsets with poses and intrinsics eliminated; `variance` of a pixel in px².

    The matrix is `by_point` (k, 3, 3) without `half`' @ `half` (6n, 3k) and without `by_camera` (3k, c) @
    `camera_covariance` @ `by_camera`'.
    """

    by_point: Array
    half: Array
    by_camera: Array
    gradient: Array
    variance: float
    redundancy: float
    pose_gradient: Array
    pose_offsets: Array
    pose_camera: Array
    camera_gradient: Array
    camera_covariance: Array

    def information(self) -> Array:
        """That matrix (3k, 3k)."""
        k, matrix = len(self.by_point), -(self.half.T @ self.half)
        matrix.reshape(k, 3, k, 3)[np.arange(k), :, np.arange(k), :] += self.by_point
        return matrix - self.by_camera @ self.camera_covariance @ self.by_camera.T if self.by_camera.size else matrix

    def left(self, shapes: Array) -> float:
        """The sum of squares, px², that a step of poses, intrinsics and these shapes (k, 3, s) leaves."""
        columns = shapes.reshape(self.gradient.size, -1)
        own = (self.by_point @ shapes).reshape(columns.shape) - self.half.T @ (self.half @ columns)
        own -= self.by_camera @ (self.camera_covariance @ (self.by_camera.T @ columns))
        gradient = columns.T @ self.gradient
        gain = gradient @ scaled_pseudo_inverse(columns.T @ own, MIN_DETERMINED) @ gradient
        return max(self.variance * self.redundancy - float(gain), MIN_VARIANCE)

    def step(self, offsets: Array, weight: Array) -> tuple[Array, Array]:
        """Step (3k,) from offsets (k, 3) whose coordinates have a prior `weight` (3,), and variances (k, 3) mm².

        With many points, what few views eliminate is inverted (M. Woodbury, "Inverting modified matrices", 1950).
        """
        gradient = self.gradient + np.tile(weight, len(offsets)) * offsets.ravel()
        if len(offsets) < MANY_POINTS or 2 * len(self.half) > offsets.size:
            covariance = np.linalg.inv(self.information() + np.diag(np.tile(weight, len(offsets))))
            return -covariance @ gradient, self.variance * np.diagonal(covariance).reshape(-1, 3)
        own = np.linalg.inv(self.by_point + np.diag(weight))
        left = np.vstack([self.half, self.by_camera.T])
        right = np.vstack([self.half, self.camera_covariance @ self.by_camera.T])
        left, solved = ((rows.T.reshape(-1, 3, len(rows)).swapaxes(1, 2) @ own) for rows in (left, right))
        left, solved = (rows.swapaxes(0, 1).reshape(right.shape) for rows in (left, solved))
        solved = np.linalg.inv(np.eye(len(right)) - right @ left.T) @ solved
        step = (own @ gradient.reshape(-1, 3, 1)).ravel() + left.T @ (solved @ gradient)
        variances = np.diagonal(own, axis1=1, axis2=2) + np.sum(left * solved, axis=0).reshape(-1, 3)
        return -step, self.variance * variances

    def back_substitute(self, offsets: Array) -> tuple[Array, Array]:
        """Steps of the poses (n, 6) and of the free intrinsics that go with a step of the offsets (3k,)."""
        camera = -(self.camera_gradient + self.camera_covariance @ self.by_camera.T @ offsets)
        return -(self.pose_gradient + self.pose_offsets @ offsets + self.pose_camera @ camera), camera


def _system(seen: Observations, camera: CameraModel, poses: Array, free: NDArray[np.bool_], k: int) -> _System:
    """The system of k points of the target; the last of them need not be seen."""
    n, m = seen.ids.shape
    columns = pixel_columns(seen, camera, poses, free_intrinsics=bool(np.any(free)))
    rows = np.ascontiguousarray(columns.transpose(0, 3, 2, 1))  # (n, m, 2, 6 [+ 9] + 1), weighted
    turned = poses[:, None, None, :3, :3]
    by_point = (rows[:, :, :, None, 3:6] @ turned)[:, :, :, 0]  # d pixel / d point of the target (n, m, 2, 3)
    residual = rows[..., -1]
    shared = rows[..., 6:-1][..., free[: rows.shape[-1] - 7]]
    c = shared.shape[-1]
    # Dense blocks by view: pose × pose, pose × offsets, pose × intrinsics.
    pose_rows = rows[..., :6].reshape(n, 2 * m, 6)
    HH = scaled_inverse(np.swapaxes(pose_rows, 1, 2) @ pose_rows)
    HS = _by_id(seen, np.swapaxes(rows[..., :6], 2, 3) @ by_point, k).transpose(0, 2, 1, 3).reshape(n, 6, 3 * k)
    HC = np.swapaxes(pose_rows, 1, 2) @ shared.reshape(n, 2 * m, c)
    hg = (np.swapaxes(pose_rows, 1, 2) @ residual.reshape(n, 2 * m, 1))[..., 0]
    back = np.swapaxes(by_point, 2, 3)
    SS = _by_id(seen, back @ by_point, k).sum(axis=0)
    SC = _by_id(seen, back @ shared, k).sum(axis=0)
    sg = _by_id(seen, back @ residual[..., None], k).sum(axis=0)
    flat = shared.reshape(2 * n * m, c)
    CC, cg = flat.T @ flat, flat.T @ residual.reshape(-1)
    # Eliminate the poses, then the intrinsics.
    zS, zC, zg = HH @ HS, HH @ HC, (HH @ hg[..., None])[..., 0]
    half = (np.swapaxes(np.linalg.cholesky(HH), 1, 2) @ HS).reshape(6 * n, -1)
    SC_ = SC.reshape(3 * k, c) - HS.reshape(6 * n, -1).T @ zC.reshape(6 * n, c)
    gS = sg.ravel() - HS.reshape(6 * n, -1).T @ zg.ravel()
    CC = CC - HC.reshape(6 * n, c).T @ zC.reshape(6 * n, c)
    gC = cg - HC.reshape(6 * n, c).T @ zg.ravel()
    inverse_CC = covariance_of(CC)
    square = float(np.sum(residual**2) - np.sum(zg * hg) - gC @ inverse_CC @ gC)
    redundancy = max(2.0 * float(np.count_nonzero(seen.weights)) - 6 * n - c, 1.0)
    return _System(
        by_point=SS, half=half, by_camera=SC_, gradient=gS - SC_ @ inverse_CC @ gC,
        variance=max(square / redundancy, MIN_VARIANCE), redundancy=redundancy, pose_gradient=zg, pose_offsets=zS,
        pose_camera=zC, camera_gradient=inverse_CC @ gC, camera_covariance=inverse_CC,
    )  # fmt: skip


def _by_id(seen: Observations, values: Array, k: int) -> Array:
    """Values (n, m, ...) of corners arranged by point id (n, k, ...); an id occurs at most once in a view."""
    if seen.ids.shape[1] == k and np.array_equal(seen.ids, np.broadcast_to(np.arange(k), seen.ids.shape)):
        return values
    result = np.zeros((len(seen), k, *values.shape[2:]))
    view, corner = np.nonzero(seen.weights)
    result[view, seen.ids[view, corner]] = values[view, corner]
    return result
