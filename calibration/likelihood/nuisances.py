"""The unknowns of a session beside X, the target's pose and the robot's poses: lens, and the target's size and shape.

None of them is exactly known, at any number of views. Their values z (q,) are deviations from the description: of a
given camera log f, cx, cy [px], radial distortion and, where the description has no tangential one, p1 and p2 [px at
the picture's corner]; of an estimated one changes of its nine intrinsics, without a prior; then the log of the target's
size, anisotropy, shear, and three bows [mm at half its size].
Shape and lens belong together: with a free lens and a rigid target, a bent or stretched print bends X.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.knowledge import BOW_SHARE, LENS_PX, TANGENTIAL_PX, Knowledge, PriorMixture, prior_mixture
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS, PixelStatistics, pixel_statistics, with_intrinsics
from calibration.transforms import Array

SHAPES = 5
"""Unknowns of the target's shape beside its size."""

FOCAL, CENTRE = (0,), (1, 2)
"""Places among z of a given camera's focal length and principal point."""

DISTORTION = (4, 6, 7)
"""Places of k1, p1 and p2 among fx fy cx cy k1 k2 p1 p2 k3."""

MIN_DISTORTION_PX = 1.0
"""Least distortion at the corner of pictures that are not rectified."""


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
        """Those of a session with a given camera, or with one that is estimated from its images.

        Tangential distortion is unknown where the description has radial distortion alone, or is nominal. Where it has
        both, they were estimated with the principal point, and the errors make up for one another; where it has none,
        pictures are rectified.
        """
        focal, half = np.diagonal(camera.matrix)[:2], np.array(camera.image_size) / 2
        off_px = focal * np.array(camera.lens.distort(*(half / focal)[:, None]))[:, 0] - half
        distorted = np.linalg.norm(off_px) > MIN_DISTORTION_PX or knowledge.camera == "nominal"
        unsaid = camera.lens_model == "pinhole" and distorted and not np.any(camera.distortion[2:4])
        tangential = 2 * (TANGENTIAL_PX[knowledge.camera],) if unsaid else ()
        distortion = () if estimated else (LENS_PX[knowledge.camera], *tangential)
        bow_mm = BOW_SHARE * _half_size_mm(nominal_mm)
        return cls(camera, nominal_mm, estimated, prior_mixture(knowledge, bow_mm, distortion))

    @property
    def first_known(self) -> int:
        """Place among z of the first unknown that has a prior."""
        return INTRINSICS if self.estimated else 0

    @property
    def size(self) -> int:
        """Place among z of the log of the target's size."""
        return self.first_known + self.prior.size

    @property
    def distortion(self) -> range:
        """Places among z of a given camera's distortion: k1, and p1 and p2 where its description leaves them out."""
        return range(3, self.prior.size)

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
        return self.estimated | np.isin(np.arange(INTRINSICS), [0, 1, 2, 3, *self._distortion])

    def __len__(self) -> int:
        return self.size + 1 + SHAPES

    def camera_at(self, z: Array) -> CameraModel:
        """The camera with the deviations z (q,)."""
        if self.estimated:
            return with_intrinsics(self.camera, z[:INTRINSICS])
        focal_x, focal_y = np.diagonal(self.camera.matrix)[:2]
        change, lens = np.zeros(INTRINSICS), self.prior.size
        change[:4] = np.expm1(z[0]) * focal_x, np.expm1(z[0]) * focal_y, z[1], z[2]
        change[self._distortion] = z[3:lens] * self._by_px
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
        by = np.delete(np.eye(found.sums.shape[-1]), 7, axis=1)
        by[[6, 7], 6] = np.diagonal(camera.matrix)[:2]
        by[range(10, 10 + len(self._by_px)), range(9, 9 + len(self._by_px))] = self._by_px
        return PixelStatistics(by.T @ found.sums @ by, found.count)

    @property
    def _distortion(self) -> list[int]:
        return list(DISTORTION[: self.prior.size - 3])

    @property
    def _by_px(self) -> Array:
        """Changes of k1, p1 and p2 that move a point as far out as the picture's corner by up to 1 px."""
        focal = float(np.sqrt(np.prod(np.diagonal(self.camera.matrix)[:2])))
        corner = float(np.hypot(*self.camera.image_size)) / 2
        return np.array([focal**2 / corner**3, *(2 * [focal / (3 * corner**2)])])[: self.prior.size - 3]

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
