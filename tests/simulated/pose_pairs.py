"""Sessions given as pairs of poses, with known truth: no pixels, isotropic errors of robot and camera."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calibration.pose_pairs.residuals import PosePairs, ScaledChain, linearise
from calibration.transforms import Array, inverse, rotation_from_vector, transform, transform_from_vector
from tests.simulated.sessions import looking

Motions = Literal["looking", "random"]
"""At a target as a camera would, 450 to 650 mm away, tilted by up to 35 degrees and rolled at will; or anyhow."""


@dataclass(frozen=True)
class PoseNoise:
    """One standard deviation per axis of the robot's pose and of the camera's."""

    robot_deg: float
    robot_mm: float
    camera_deg: float
    camera_mm: float

    def __str__(self) -> str:
        return f"{self.robot_deg:g} deg {self.robot_mm:g} mm, {self.camera_deg:g} deg {self.camera_mm:g} mm"


@dataclass(frozen=True, eq=False)
class PoseSession:
    """What was reported (n, 4, 4), the truth, and the Cramér-Rao bound (6, 6) of X, [rad, mm], levels known."""

    anchor_T_mount: Array
    camera_T_target: Array
    mount_T_camera: Array
    bound: Array


def drawn_session(rng: np.random.Generator, n: int, noise: PoseNoise, motions: Motions) -> PoseSession:
    """Eye in hand, with a random X and target."""
    X = transform(rotation_from_vector(rng.standard_normal(3)), 80 * rng.standard_normal(3))
    Y = transform(rotation_from_vector(rng.standard_normal(3)), 500 * rng.standard_normal(3))
    seen = np.array([looking(rng) if motions == "looking" else _anyhow(rng) for _ in range(n)])
    stands = Y @ inverse(X @ seen)
    told = stands @ _errors(rng, n, noise.robot_deg, noise.robot_mm)
    off = _errors(rng, n, noise.camera_deg, noise.camera_mm)
    found = transform(off[:, :3, :3] @ seen[:, :3, :3], seen[:, :3, 3] + off[:, :3, 3])
    return PoseSession(told, found, X, _bound(PosePairs("eye-in-hand", stands, seen), ScaledChain(X, Y), noise))


def with_alike_errors(rng: np.random.Generator, camera_T_target: Array, deg: float, mm: float) -> Array:
    """The camera's poses (n, 4, 4) with errors that are waves of where and how the target stands."""
    where = np.concatenate([camera_T_target[:, :3, 3] / 100, camera_T_target[:, :3, :3].reshape(-1, 9)], axis=1)
    waves = [np.sin(where @ rng.standard_normal(12) + rng.uniform(0, 2 * np.pi)) for _ in range(3)]
    errors = np.sqrt(2 / 3) * np.stack(waves, axis=1) @ rng.standard_normal((3, 6))
    off = transform_from_vector(errors * np.repeat([np.radians(deg), mm], 3))
    return transform(off[:, :3, :3] @ camera_T_target[:, :3, :3], camera_T_target[:, :3, 3] + off[:, :3, 3])


def _anyhow(rng: np.random.Generator) -> Array:
    turn = rotation_from_vector(rng.standard_normal(3))
    return transform(turn, np.array([0.0, 0.0, 550.0]) + 150 * rng.standard_normal(3))


def _errors(rng: np.random.Generator, n: int, deg: float, mm: float) -> Array:
    return transform(
        rotation_from_vector(np.radians(deg) * rng.standard_normal((n, 3))), mm * rng.standard_normal((n, 3))
    )


def _bound(truth: PosePairs, chain: ScaledChain, noise: PoseNoise) -> Array:
    at = linearise(truth, chain)
    robot = at.by_flange * np.repeat([np.radians(noise.robot_deg), noise.robot_mm], 3)
    camera = np.diag(np.repeat([np.radians(noise.camera_deg), noise.camera_mm], 3) ** 2)
    information = np.linalg.inv(robot @ np.swapaxes(robot, 1, 2) + camera)
    bound: Array = np.linalg.inv((np.swapaxes(at.by_shared, 1, 2) @ information @ at.by_shared).sum(axis=0))[:6, :6]
    return bound
