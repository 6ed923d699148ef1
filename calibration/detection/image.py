"""Checks and conversion of images for the detectors, and downscaling."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.errors import DetectionError
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array

Grey = NDArray[np.uint8]

MIN_SIDE_PX = 32
MIN_GREY_LEVELS = 12
"""Least difference between black and white of a target; below it the target does not stand out from noise."""


def grey_image(image: NDArray[Any]) -> Grey:
    """The image (h, w) as uint8; three channels (h, w, 3) in any order are mixed.

    Raises DetectionError `image-type`, `image-shape`, `image-too-small`, `image-black`, `image-saturated`,
    `image-flat`.
    """
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = f"an array of {image.dtype}" if isinstance(image, np.ndarray) else f"a {type(image).__name__}"
        raise DetectionError("image-type", Sentence("seen-image-type", kind=kind), Sentence("see-8-bit"))
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3)):
        raise DetectionError("image-shape", Sentence("seen-image-shape", shape=str(image.shape)), Sentence("see-shape"))
    if min(image.shape[:2]) < MIN_SIDE_PX:
        height, width = image.shape[:2]
        what = Sentence("seen-image-small", width=width, height=height, least=MIN_SIDE_PX)
        raise DetectionError("image-too-small", what, Sentence("see-whole-images"))
    if image.ndim == 3:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)) if image.shape[2] == 3 else image[:, :, 0]
    grey: Grey = np.ascontiguousarray(image)
    _require_contrast(grey[:: max(1, grey.shape[0] // 256), :: max(1, grey.shape[1] // 256)])
    return grey


def _require_contrast(sample: Grey) -> None:
    dark, bright = (int(level) for level in np.percentile(sample, [0.1, 99.9]))
    if bright < MIN_GREY_LEVELS:
        raise DetectionError("image-black", Sentence("seen-black", brightest=bright), Sentence("see-light"))
    if dark > 255 - MIN_GREY_LEVELS:
        raise DetectionError("image-saturated", Sentence("seen-white", darkest=dark), Sentence("see-shorter"))
    if bright - dark < MIN_GREY_LEVELS:
        raise DetectionError("image-flat", Sentence("seen-flat", levels=bright - dark), Sentence("see-camera-sees"))


def downscale(image: Grey, pixels: float) -> tuple[Grey, int]:
    """The image reduced by the least whole factor that leaves at most `pixels` pixels, and that factor."""
    factor = max(1, int(np.ceil(np.sqrt(image.size / pixels))))
    return downscale_by(image, factor), factor


def downscale_by(image: Grey, factor: int) -> Grey:
    """The image (h // factor, w // factor) of means over `factor`² pixels; incomplete blocks are cut off."""
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    cut = image[: height * factor, : width * factor]
    return np.asarray(cv2.resize(cut, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def to_full_size(points_px: Array, factor: int) -> Array:
    """Points (n, 2) of an image reduced by `factor`, in the full image's pixels."""
    return (points_px + 0.5) * factor - 0.5
