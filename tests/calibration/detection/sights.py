"""What the detection's tests share: a camera of 2 MP, pictures of targets, and how far a detection is off."""

from functools import lru_cache

import numpy as np

from calibration.problem import Detection
from calibration.targets import Target
from calibration.transforms import Array
from mock_robot.scene.optics import Optics
from mock_robot.scene.printed_target import PrintOptions
from tests.simulated.views import ORDINARY, TruePicture, industrial_camera, take_picture

CAMERA = industrial_camera(1600, 1200)


def pictures(
    target: Target,
    count: int = 3,
    optics: Optics = ORDINARY,
    *,
    seed: int = 1,
    tilt_deg: float = 40.0,
    fill: float = 0.75,
    sheet: PrintOptions | None = None,
) -> list[TruePicture]:
    """Pictures of the target from all around, each with its truth; rendered once, and not to be written to."""
    return list(_rendered(target, count, optics, seed, tilt_deg, fill, sheet))


@lru_cache(maxsize=16)
def _rendered(
    target: Target, count: int, optics: Optics, seed: int, tilt_deg: float, fill: float, sheet: PrintOptions | None
) -> tuple[TruePicture, ...]:
    rng = np.random.default_rng(seed)
    taken = tuple(take_picture(CAMERA, target, rng, optics, tilt_deg, fill, sheet) for _ in range(count))
    for picture in taken:
        picture.image.setflags(write=False)
    return taken


def errors_px(detection: Detection, picture: TruePicture) -> Array:
    """Detected minus true (n, 2)."""
    return detection.corners_px - picture.pixels[detection.ids]


def half_turned(detection: Detection, count: int) -> Detection:
    """The same points counted from the other end."""
    return Detection(count - 1 - detection.ids, detection.corners_px)


def rms(errors: list[Array]) -> float:
    """Per axis."""
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
