"""The part to be scanned: a car door's outer skin as a smooth height field with a window, a handle and a lock.

Part frame: origin in the middle of the door, x along its length, y up, z out of the skin towards the viewer.
"""

from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array

FOOT_ITERATIONS = 60
FOOT_TOLERANCE_MM = 1e-9
EDGE_ITERATIONS = 4
EDGE_STEP_MM = 1e-5


def polygon_distance(x: Array, y: Array, corners: Array) -> Array:
    """Signed distance of points to a simple polygon (n, 2), negative inside."""
    nearest = np.full(np.shape(x), np.inf)
    inside = np.zeros(np.shape(x), bool)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        ex, ey = bx - ax, by - ay
        along = np.clip(((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey), 0.0, 1.0)
        nearest = np.minimum(nearest, (x - ax - along * ex) ** 2 + (y - ay - along * ey) ** 2)
        crossed = (ay > y) != (by > y)
        if ey != 0.0:
            inside ^= crossed & (x < ax + ex * (y - ay) / ey)
    distance: Array = np.sqrt(nearest)
    return np.where(inside, -distance, distance)


@dataclass(frozen=True)
class RoundedPolygon:
    """A polygon grown by `radius_mm`, which rounds its corners."""

    corners_mm: tuple[tuple[float, float], ...]
    radius_mm: float

    def distance(self, x: Array, y: Array) -> Array:
        """Signed distance in mm, negative inside."""
        return polygon_distance(x, y, np.array(self.corners_mm)) - self.radius_mm


@dataclass(frozen=True)
class Door:
    """All lengths in mm. Swept curvature, a crease, a handle's recess, a window and a lock."""

    radius_along: float = 5000.0
    radius_up: float = 1400.0
    crease_height: float = -60.0
    crease_rise: float = 0.06
    crease_slope: float = 0.12
    crease_width: float = 6.0
    handle: tuple[float, float] = (370.0, 20.0)
    handle_size: tuple[float, float] = (80.0, 30.0)
    handle_depth: float = 12.0
    lock: tuple[float, float, float] = (520.0, 10.0, 14.0)
    outline: RoundedPolygon = RoundedPolygon(
        ((-560.0, -260.0), (560.0, -260.0), (560.0, 200.0), (470.0, 260.0), (-300.0, 260.0), (-560.0, 70.0)), 40.0
    )
    window: RoundedPolygon = RoundedPolygon(((-380.0, 130.0), (380.0, 130.0), (380.0, 225.0), (-265.0, 225.0)), 20.0)

    def height(self, x: Array, y: Array) -> Array:
        """z of the skin; also defined where there is no metal, beyond the outline and in the cut-outs."""
        height: Array = self.envelope(x, y) - self.handle_depth * self._recess(x, y)
        return height

    def envelope(self, x: Array, y: Array) -> Array:
        """z of the skin without the handle's recess: nowhere below the skin, and concave in x and y."""
        across = y - self.crease_height - self.crease_rise * x
        bend = self.crease_slope * (np.sqrt(across * across + self.crease_width**2) - self.crease_width)
        envelope: Array = -x * x / (2 * self.radius_along) - y * y / (2 * self.radius_up) - bend
        return envelope

    def slope(self, x: Array, y: Array) -> tuple[Array, Array]:
        """dz/dx and dz/dy."""
        envelope_x, envelope_y = self.envelope_slope(x, y)
        recess = 4 * self.handle_depth * self._recess(x, y)
        along_x = recess * ((x - self.handle[0]) / self.handle_size[0]) ** 3 / self.handle_size[0]
        along_y = recess * ((y - self.handle[1]) / self.handle_size[1]) ** 3 / self.handle_size[1]
        return envelope_x + along_x, envelope_y + along_y

    def envelope_slope(self, x: Array, y: Array) -> tuple[Array, Array]:
        """dz/dx and dz/dy of the envelope."""
        across = y - self.crease_height - self.crease_rise * x
        bend = self.crease_slope * across / np.sqrt(across * across + self.crease_width**2)
        return -x / self.radius_along + bend * self.crease_rise, -y / self.radius_up - bend

    def _recess(self, x: Array, y: Array) -> Array:
        u = (x - self.handle[0]) / self.handle_size[0]
        v = (y - self.handle[1]) / self.handle_size[1]
        u, v = u * u, v * v
        recess: Array = np.exp(-(u * u + v * v))
        return recess

    @property
    def steepest(self) -> float:
        """Upper bound of the skin's slope over the door."""
        recess = 1.55 * self.handle_depth / min(self.handle_size)  # max of 4 s^3 exp(-s^4) is 1.5505
        return recess + self.crease_slope + 700.0 / self.radius_along + 350.0 / self.radius_up

    def edge_distance(self, x: Array, y: Array) -> Array:
        """Signed distance to the metal's edge in the x-y plane, negative where there is metal."""
        lock = np.hypot(x - self.lock[0], y - self.lock[1]) - self.lock[2]
        edges = np.maximum(self.outline.distance(x, y), -self.window.distance(x, y))
        distance: Array = np.maximum(edges, -lock)
        return distance

    def normal(self, x: Array, y: Array) -> Array:
        """Unit normals (n, 3) out of the skin."""
        along_x, along_y = self.slope(x, y)
        normal = np.stack([-along_x, -along_y, np.ones_like(along_x)], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return normal

    def deviation(self, points_part: Array) -> Array:
        """Signed distance (n,) of points (n, 3) to the nearest metal, positive in front of the skin."""
        foot = self.foot(points_part)
        off = points_part - np.column_stack([foot, self.height(*foot.T)])
        side = np.sign(np.sum(off * self.normal(*foot.T), axis=1))
        deviation: Array = np.where(side < 0, -1.0, 1.0) * np.linalg.norm(off, axis=1)
        return deviation

    def foot(self, points_part: Array) -> Array:
        """x, y (n, 2) of the nearest metal to each point: Gauss-Newton, projected onto the metal's edge where needed.

        The step is damped where the skin curves towards the point. Points farther away than the skin's smallest radius
        of curvature (about 20 mm at the handle) get a nearby foot there, not always the nearest.
        """
        foot = self.onto_metal(points_part[:, :2].copy())
        active = np.arange(len(foot))
        for _ in range(FOOT_ITERATIONS):
            point, now = points_part[active], foot[active]
            moved = self.onto_metal(now + self._step(point, now))
            foot[active] = moved
            active = active[np.abs(moved - now).max(axis=1, initial=0.0) > FOOT_TOLERANCE_MM]
            if not len(active):
                break
        return foot

    def _step(self, point: Array, foot: Array) -> Array:
        """(J' J) step = -J' r with r = (x, y, h) - p and J = [I; slope]; its inverse by Sherman and Morrison."""
        sx, sy = self.slope(*foot.T)
        off_z = self.height(*foot.T) - point[:, 2]
        gx, gy = foot[:, 0] - point[:, 0] + sx * off_z, foot[:, 1] - point[:, 1] + sy * off_z
        shared = (sx * gx + sy * gy) / (1 + sx * sx + sy * sy)
        step: Array = -np.column_stack([gx - sx * shared, gy - sy * shared])
        damping = 1.0 / (1.0 + np.maximum(np.abs(off_z) - 5.0, 0.0) / 20.0)
        return step * damping[:, None]

    def onto_metal(self, foot: Array) -> Array:
        """Move points off the metal to its edge along the distance's gradient.

        Its forward difference, unlike the central one, does not vanish in the middle of a cut-out.
        """
        outside = np.flatnonzero(self.edge_distance(*foot.T) > 0)
        for _ in range(EDGE_ITERATIONS):
            if not len(outside):
                break
            x, y = foot[outside].T
            distance = self.edge_distance(x, y)
            beside = np.stack(
                [self.edge_distance(x + EDGE_STEP_MM, y), self.edge_distance(x, y + EDGE_STEP_MM)], axis=1
            )
            gradient = (beside - distance[:, None]) / EDGE_STEP_MM
            size = np.maximum(np.sum(gradient * gradient, axis=1, keepdims=True), 1e-6)
            foot[outside] -= np.maximum(distance, 0.0)[:, None] * gradient / size
        return foot


DOOR = Door()


def surface_samples(step_mm: float, door: Door = DOOR) -> Array:
    """Points (n, 3) on the metal in the part frame, one for each `step_mm` squared of its x-y area."""
    x, y = np.meshgrid(np.arange(-620.0, 620.0, step_mm), np.arange(-320.0, 320.0, step_mm))
    x, y = x.ravel(), y.ravel()
    metal = door.edge_distance(x, y) < 0
    x, y = x[metal], y[metal]
    return np.column_stack([x, y, door.height(x, y)])
