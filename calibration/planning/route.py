"""The order in which to visit poses, for short moves."""

import numpy as np

from calibration.transforms import Array, rotation_angle_rad

TURN_MM_PER_RAD = 300.0
"""Travel that a turn of one radian counts as, about that of the camera on its lever arm."""


def visiting_order(base_T_flange: Array, start: Array | None = None) -> list[int]:
    """Indices (n,) of the poses (n, 4, 4) from `start` (4, 4), or from the first: nearest neighbour, then 2-opt."""
    poses = base_T_flange if start is None else np.concatenate([start[None], base_T_flange])
    length = _lengths(poses)
    route = _two_opt(_nearest_neighbour(length), length)
    return route if start is None else [index - 1 for index in route[1:]]


def _lengths(poses: Array) -> Array:
    relative = np.swapaxes(poses[:, None, :3, :3], -1, -2) @ poses[None, :, :3, :3]
    travel = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=-1)
    n = len(poses)
    turn = np.reshape(rotation_angle_rad(relative.reshape(-1, 3, 3)), (n, n))
    lengths: Array = travel + TURN_MM_PER_RAD * turn
    return lengths


def _nearest_neighbour(length: Array) -> list[int]:
    route, left = [0], set(range(1, len(length)))
    while left:
        nearest = min(left, key=lambda index: float(length[route[-1], index]))
        route.append(nearest)
        left.remove(nearest)
    return route


def _two_opt(route: list[int], length: Array) -> list[int]:
    """The route shortened by 2-opt, open, with a fixed beginning."""

    def total(order: list[int]) -> float:
        return float(length[order[:-1], order[1:]].sum())

    improved = True
    while improved:
        improved = False
        for i in range(1, len(route) - 1):
            for j in range(i + 1, len(route)):
                other = route[:i] + route[i : j + 1][::-1] + route[j + 1 :]
                if total(other) < total(route) - 1e-9:
                    route, improved = other, True
    return route
