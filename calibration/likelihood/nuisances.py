"""The unknowns of a session beside X, the target's pose and the robot's poses: lens, and the target's size and shape.

None of them is exactly known, at any number of views. Their values z (q,) are deviations from the description: of a
given camera log f, cx, cy [px], radial distortion and, where the description leaves it open or images show it, p1 and
p2 [px at the picture's corner]; of an estimated one changes of its nine intrinsics, without a prior; then the log of
the target's size, anisotropy, shear, three bows [mm at half its size], and where images show them six bends of its
lines, of which keystones are made; last those of `Observations.effects`, which differ from view to view.
Shape and lens belong together: with a free lens and a rigid target, a bent or stretched print bends X. Images alone
hardly show whether it is a keystone or a principal point, so shapes are estimated with X. What a point has for itself
comes from images.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.knowledge import (
    BEND_SHARE,
    BOW_SHARE,
    LENS_PX,
    OTHER_LENS_PX,
    TANGENTIAL_PX,
    Knowledge,
    PriorMixture,
    prior_mixture,
    with_unknowns,
)
from calibration.likelihood.mapped_points import point_rows
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS, PixelStatistics, pixel_statistics, with_intrinsics
from calibration.transforms import Array

FOCAL, CENTRE, TANGENTIAL = (0,), (1, 2), (4, 5)
"""Places among z of a given camera's focal length, principal point and, where they are unknown, p1 and p2."""

DISTORTION = (4, 6, 7)
"""Places of k1, p1 and p2 among fx fy cx cy k1 k2 p1 p2 k3."""

SHAPES = 5
"""Shapes that are unknown of every target: all but the bends."""

NOT_SEEN_MM = 1e-9
"""A point that is found nearer to the drawn one was not seen."""

MIN_DISTORTION_PX = 1.0
"""Least distortion at the corner of pictures that are not rectified."""


@dataclass(frozen=True, eq=False)
class Nuisances:
    """`camera` as given or first estimated; `points_mm` (k, 3) the target's points with neither size nor shape.

    `shapes` (k, 3, s): what one unit of each shape adds to them. `prior`: of the unknowns from `first_known` on.
    `shows_tangential`: tangential distortion is among them since it shows; a thin prism looks alike.
    `effects`: what differs from view to view, by the codes of its findings.
    """

    camera: CameraModel
    points_mm: Array
    shapes: Array
    estimated: bool
    prior: PriorMixture
    shows_tangential: bool = False
    effects: tuple[str, ...] = ()

    @classmethod
    def of(cls, camera: CameraModel, nominal_mm: Array, knowledge: Knowledge, *, estimated: bool) -> "Nuisances":
        """Those of a session with a given camera, or with one that is estimated from its images.

        Tangential distortion is unknown where the description has radial distortion alone, or is nominal. Where it has
        both, they were estimated with the principal point, and the errors make up for one another; where it has none,
        pictures are rectified. There it is unknown only where it shows (`with_tangential`).
        """
        focal, half = np.diagonal(camera.matrix)[:2], np.array(camera.image_size) / 2
        off_px = focal * np.array(camera.lens.distort(*(half / focal)[:, None]))[:, 0] - half
        distorted = np.linalg.norm(off_px) > MIN_DISTORTION_PX or knowledge.camera == "nominal"
        unsaid = camera.lens_model == "pinhole" and distorted and not np.any(camera.distortion[2:4])
        tangential = 2 * (TANGENTIAL_PX[knowledge.camera],) if unsaid else ()
        distortion = () if estimated else (LENS_PX[knowledge.camera], *tangential)
        bow_mm = BOW_SHARE * _half_size_mm(nominal_mm)
        prior = prior_mixture(knowledge, bow_mm, distortion)
        return cls(camera, nominal_mm, target_shapes(nominal_mm)[..., :SHAPES], estimated, prior)

    @property
    def knows_tangential(self) -> bool:
        """Whether p1 and p2 of a given camera count as known."""
        return not self.estimated and self.camera.lens_model == "pinhole" and len(self.distortion) == 1

    def with_tangential(self) -> "Nuisances":
        """With p1 and p2 as of another lens, after k1."""
        return replace(self, shows_tangential=True, prior=with_unknowns(self.prior, TANGENTIAL[0], OTHER_LENS_PX[1:]))

    def with_bends(self) -> "Nuisances":
        """With bends in the plane among the shapes."""
        bend_mm, shapes = BEND_SHARE * _half_size_mm(self.points_mm), target_shapes(self.points_mm)
        prior = with_unknowns(self.prior, len(self.prior.usual), (shapes.shape[-1] - SHAPES) * (bend_mm,))
        return replace(self, shapes=shapes, prior=prior)

    def with_effect(self, code: str, sigma: float) -> "Nuisances":
        """With an effect on the points that differs from view to view, after all others."""
        prior = with_unknowns(self.prior, len(self.prior.usual), (sigma,))
        return replace(self, effects=(*self.effects, code), prior=prior)

    def with_points(self, found_mm: Array) -> tuple["Nuisances", Array]:
        """With bends, and of points found in images (k, 3) what no size and shape explains; those as z (q,).

        A point where `points_mm` has it was not seen, and stays.
        """
        found = self if self.shapes.shape[-1] > SHAPES else self.with_bends()
        off, own = found_mm - self.points_mm, self.points_mm - self.points_mm.mean(axis=0)
        columns = np.concatenate([point_rows(own), own[..., None], found.shapes], axis=-1)
        seen = np.any(np.abs(off) > NOT_SEEN_MM, axis=1)
        by = np.linalg.lstsq(columns[seen].reshape(-1, columns.shape[-1]), off[seen].ravel(), rcond=None)[0]
        found = replace(found, points_mm=self.points_mm + np.where(seen[:, None], off - columns @ by, 0.0))
        z = np.zeros(len(found))
        z[found.size], z[found.shape] = np.log1p(by[6]), by[7:]
        return found, z

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
        return range(self.size + 1, len(self) - len(self.effects))

    def shape_mm(self, z: Array, nominal_mm: Array) -> tuple[float, float]:
        """RMS deviation of the points from the drawn ones (k, 3), in the plane (per coordinate) and out of it."""
        off = self.points_mm + self.shapes @ z[self.shape] - nominal_mm
        return float(np.sqrt(np.mean(off[:, :2] ** 2))), float(np.sqrt(np.mean(off[:, 2] ** 2)))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of fx fy cx cy k1 k2 p1 p2 k3 are unknown (9,)."""
        return self.estimated | np.isin(np.arange(INTRINSICS), [0, 1, 2, 3, *self._distortion])

    def __len__(self) -> int:
        return self.size + 1 + int(self.shapes.shape[-1]) + len(self.effects)

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
        return np.asarray(self.scale_at(z) * (self.points_mm + self.shapes @ z[self.shape]))

    def seen_at(self, seen: Observations, z: Array) -> Observations:
        """The observations with the target's points at the deviations z (q,)."""
        return replace(seen, points_mm=self.points_at(z)[seen.ids] + seen.effects @ z[self.shape.stop :])

    def statistics(self, seen: Observations, camera_T_target: Array, z: Array) -> PixelStatistics:
        """Sums of [pose, z, residual] of every view at poses (n, 4, 4) and deviations z (q,)."""
        there, camera = self.seen_at(seen, z), self.camera_at(z)
        by_size, by_shape = there.points_mm[..., None], self.scale_at(z) * self.shapes[seen.ids]
        modes = np.concatenate([by_size, by_shape, seen.effects], axis=-1)
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


def target_shapes(nominal_mm: Array) -> Array:
    """Displacements (k, 3, 11) of the points (k, 3) by one unit of anisotropy, shear, three bows and six bends."""
    off = nominal_mm - nominal_mm.mean(axis=0)
    x, y, nothing = off[:, 0], off[:, 1], np.zeros(len(off))
    u, v = off[:, :2].T / _half_size_mm(nominal_mm)
    columns = (
        (x / 2, -y / 2, nothing),
        (y, nothing, nothing),
        *((nothing, nothing, w) for w in (u * u, v * v, u * v)),
        *((w, nothing, nothing) for w in (u * u, v * v, u * v)),
        *((nothing, w, nothing) for w in (u * u, v * v, u * v)),
    )
    return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)


def _half_size_mm(points_mm: Array) -> float:
    """Half the larger side of the target, 1 mm at least."""
    return max(float(np.ptp(points_mm[:, :2], axis=0).max()) / 2, 1.0)
