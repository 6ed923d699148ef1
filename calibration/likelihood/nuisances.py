"""The unknowns of a session beside X, the target's pose and the robot's poses: lens, and the target's size and shape.

None of them is exactly known, at any number of views. Their values z (q,) are deviations from the description: of a
given camera log f, cx, cy [px], radial distortion [px at the picture's corner]; of an estimated one changes of its nine
intrinsics, without a prior; then the log of the target's size, anisotropy, shear, and three bows [mm at half its size].
Shape and lens belong together: with a free lens and a rigid target, a bent or stretched print bends X.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.knowledge import BOW_SHARE, Knowledge, PriorMixture, prior_mixture
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS, PixelStatistics, pixel_statistics, with_intrinsics
from calibration.transforms import Array

GIVEN_LENS, SHAPES = 4, 5
"""Unknowns of a given lens, and of the target's shape beside its size."""

FOCAL, CENTRE = (0,), (1, 2)
"""Places among z of a given camera's focal length and principal point."""

BY_GIVEN_LENS = np.arange(INTRINSICS) < GIVEN_LENS + 1
"""Of fx fy cx cy k1 k2 p1 p2 k3: those that the unknowns of a given lens change."""


@dataclass(frozen=True, eq=False)
class Nuisances:
    """`camera` as given or first estimated; `nominal_mm` (k, 3) the target's points as described.

    `prior`: of the unknowns from `first_known` on.
    """

    camera: CameraModel
    nominal_mm: Array
    estimated: bool
    prior: PriorMixture

    @classmethod
    def of(cls, camera: CameraModel, nominal_mm: Array, knowledge: Knowledge, *, estimated: bool) -> "Nuisances":
        """Those of a session with a given camera, or with one that is estimated from its images."""
        prior = prior_mixture(knowledge, BOW_SHARE * _half_size_mm(nominal_mm), lens=not estimated)
        return cls(camera, nominal_mm, estimated, prior)

    @property
    def first_known(self) -> int:
        """Place among z of the first unknown that has a prior."""
        return INTRINSICS if self.estimated else 0

    @property
    def size(self) -> int:
        """Place among z of the log of the target's size."""
        return self.first_known + self.prior.size

    @property
    def shape(self) -> range:
        """Places among z of the target's shape."""
        return range(self.size + 1, self.size + 1 + SHAPES)

    def shape_mm(self, z: Array) -> tuple[float, float]:
        """RMS deviation of the target's points from the drawing, in its plane (per coordinate) and out of it."""
        off = self._shapes() @ z[self.shape]
        return float(np.sqrt(np.mean(off[:, :2] ** 2))), float(np.sqrt(np.mean(off[:, 2] ** 2)))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of fx fy cx cy k1 k2 p1 p2 k3 are unknown (9,)."""
        return np.ones(INTRINSICS, bool) if self.estimated else BY_GIVEN_LENS

    def __len__(self) -> int:
        return self.size + 1 + SHAPES

    def camera_at(self, z: Array) -> CameraModel:
        """The camera with the deviations z (q,)."""
        if self.estimated:
            return with_intrinsics(self.camera, z[:INTRINSICS])
        focal_x, focal_y = np.diagonal(self.camera.matrix)[:2]
        stretch = np.expm1(z[0])
        change = np.array([stretch * focal_x, stretch * focal_y, z[1], z[2], z[3] * self._k1_by_px, *np.zeros(4)])
        return with_intrinsics(self.camera, change)

    def scale_at(self, z: Array) -> float:
        """The target's size against the description."""
        return float(np.exp(z[self.size]))

    def points_at(self, z: Array) -> Array:
        """The target's points (k, 3) at the deviations z (q,), mm."""
        return np.asarray(self.scale_at(z) * (self.nominal_mm + self._shapes() @ z[self.shape]))

    def seen_at(self, seen: Observations, z: Array) -> Observations:
        """The observations with the target's points at the deviations z (q,)."""
        shape = z[self.shape]
        points = seen.points_mm + self._shapes()[seen.ids] @ shape if np.any(shape) else seen.points_mm
        return replace(seen, points_mm=self.scale_at(z) * points)

    def statistics(self, seen: Observations, camera_T_target: Array, z: Array) -> PixelStatistics:
        """Sums of [pose, z, residual] of every view at poses (n, 4, 4) and deviations z (q,)."""
        there, camera = self.seen_at(seen, z), self.camera_at(z)
        modes = np.concatenate([there.points_mm[..., None], self.scale_at(z) * self._shapes()[seen.ids]], axis=-1)
        found = pixel_statistics(there, camera, camera_T_target, free_intrinsics=self.free, shape_modes=modes)
        if self.estimated:
            return found
        by = np.zeros((found.sums.shape[-1], found.sums.shape[-1] - 1))
        by[:6, :6], by[11:, 10:] = np.eye(6), np.eye(len(by) - 11)
        by[[6, 7], 6] = np.diagonal(camera.matrix)[:2]
        by[8, 7], by[9, 8], by[10, 9] = 1.0, 1.0, self._k1_by_px
        return PixelStatistics(by.T @ found.sums @ by, found.count)

    @property
    def _k1_by_px(self) -> float:
        """Change of k1 that moves a point at the picture's corner by 1 px."""
        focal = float(np.sqrt(np.prod(np.diagonal(self.camera.matrix)[:2])))
        return focal**2 / float(np.hypot(*self.camera.image_size) / 2) ** 3

    def _shapes(self) -> Array:
        """Displacements (k, 3, 5) of the points by one unit of anisotropy, shear and three bows."""
        off = self.nominal_mm - self.nominal_mm.mean(axis=0)
        x, y, nothing = off[:, 0], off[:, 1], np.zeros(len(off))
        u, v = off[:, :2].T / _half_size_mm(self.nominal_mm)
        columns = (
            (x / 2, -y / 2, nothing),
            (y, nothing, nothing),
            *((nothing, nothing, w) for w in (u * u, v * v, u * v)),
        )
        return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)


def _half_size_mm(points_mm: Array) -> float:
    """Half the larger side of the target, 1 mm at least."""
    return max(float(np.ptp(points_mm[:, :2], axis=0).max()) / 2, 1.0)
