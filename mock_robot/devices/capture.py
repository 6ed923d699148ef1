"""Simulated captures of camera and scanner at rest or in motion; pure functions of the given random generator."""

from dataclasses import dataclass
from zlib import crc32

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array, difference, inverse, rotation_from_vector, transform, vector_from_rotation
from mock_robot.scene.camera_view import render, render_smeared
from mock_robot.scene.scanner_view import ScannerModel, scan
from mock_robot.truth.truth import CellTruth

STILL_MM, STILL_RAD = 1e-4, 1e-7
SMEARED_POSES, SCAN_BANDS = 7, 12
PNG_SPEED = [cv2.IMWRITE_PNG_COMPRESSION, 1]
BEHIND = transform(np.eye(3), [0.0, 0.0, -1e4])


@dataclass(frozen=True, eq=False)
class Exposure:
    """True flange poses at the start and the end of a capture."""

    begin_base_T_flange: Array
    end_base_T_flange: Array

    def poses(self, count: int) -> list[Array]:
        """base_T_flange at `count` evenly spaced moments; one pose when the flange stood still."""
        moved_mm, turned_rad = difference(self.begin_base_T_flange, self.end_base_T_flange)
        if moved_mm < STILL_MM and turned_rad < STILL_RAD:
            return [self.begin_base_T_flange]
        step = inverse(self.begin_base_T_flange) @ self.end_base_T_flange
        turn = vector_from_rotation(step[:3, :3])
        return [
            self.begin_base_T_flange @ transform(rotation_from_vector(part * turn), part * step[:3, 3])
            for part in (np.arange(count) + 0.5) / count
        ]


def picture(truth: CellTruth, exposure: Exposure, hidden: bool, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Camera image (h, w), smeared when the flange moved. `hidden`: the target is covered.

    What lies around the target stays as it is while the flange stands; the noise is drawn from `rng`.
    """
    surroundings = np.random.default_rng([truth.seed, _number_of_place(exposure.begin_base_T_flange)])
    poses = [
        BEHIND if hidden else truth.camera_T_target(base_T_flange) for base_T_flange in exposure.poses(SMEARED_POSES)
    ]
    if len(poses) == 1:
        return render(truth.camera, truth.target, poses[0], truth.optics, rng, truth.sheet, surroundings)
    return render_smeared(truth.camera, truth.target, poses, truth.optics, rng, truth.sheet, surroundings)


def _number_of_place(base_T_flange: Array) -> int:
    """The same for a flange that stands; another one, but for moves of less than 0.01 mm or 0.6 degrees."""
    return crc32(np.round(base_T_flange[:3], 2).tobytes())


def cloud(truth: CellTruth, exposure: Exposure, rng: np.random.Generator) -> NDArray[np.float32]:
    """Points (n, 3) in the scanner frame, mm; sheared when the flange moved."""
    part_T_base = inverse(truth.base_T_part)
    poses = [part_T_base @ truth.base_T_scanner(pose) for pose in exposure.poses(SCAN_BANDS)]
    return scan(ScannerModel(noise_mm=truth.noise.scanner_mm), poses, rng)


def png(image: NDArray[np.uint8]) -> bytes:
    """Encode the image as a PNG file."""
    _, encoded = cv2.imencode(".png", image, PNG_SPEED)
    return encoded.tobytes()
