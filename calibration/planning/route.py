"""The order in which to visit poses, for short moves."""

from itertools import pairwise

import numpy as np

from calibration.transforms import Array, rotation_angle_rad

TURN_MM_PER_RAD = 300.0
"""Travel that a turn of one radian counts as, about that of the camera on its lever arm."""

STOP_S = 1.2
"""Seconds of a stop with its picture."""


def visiting_order(base_T_flange: Array, start: Array | None = None) -> list[int]:
    """Indices (n,) of the poses (n, 4, 4) from `start` (4, 4), or from the first: nearest neighbour, then 2-opt."""
    poses = base_T_flange if start is None else np.concatenate([start[None], base_T_flange])
    length = np.array([travel_from(pose, poses) for pose in poses])
    route = _two_opt(_nearest_neighbour(length), length)
    return route if start is None else [index - 1 for index in route[1:]]


def travel_from(start: Array, poses: Array) -> Array:
    """Lengths (n,) mm of moves from `start` (4, 4) to poses (n, 4, 4), turns included."""
    turn_rad = rotation_angle_rad(start[:3, :3].T @ poses[:, :3, :3])
    lengths: Array = np.linalg.norm(poses[:, :3, 3] - start[:3, 3], axis=-1) + TURN_MM_PER_RAD * turn_rad
    return lengths


def lengths_with_one_more(start: Array, poses: Array, more: Array) -> Array:
    """Lengths (n,) mm of routes from `start` (4, 4) through `poses` (m, 4, 4) and one of `more` (n, 4, 4), put in where
    it costs least."""
    route = np.concatenate([start[None], poses[visiting_order(poses, start)]])
    to_each = np.array([travel_from(pose, more) for pose in route])
    legs = np.array([travel_from(pose, after[None])[0] for pose, after in pairwise(route)])
    between: Array = to_each[:-1] + to_each[1:] - legs[:, None]
    longer: Array = np.concatenate([between, to_each[-1:]]).min(axis=0)
    longer += legs.sum()
    return longer


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
