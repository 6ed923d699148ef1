"""Detection of the target in a view's picture, for folders that are read and folders that are being written."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import Target
from daemon.sessions.session_files import read_levels
from drivers.cameras.pixel_depth import content_white, to_8_bit

BRIGHT_PERCENTILES = (99.5, 90.0)
"""Grey levels that become white when the target is not found in the whole range of a 16-bit picture."""


def detect_in_file(file: Path, target: Target) -> tuple[Detection | DetectionError, tuple[int, int]]:
    """The target's detection, or why there is none, and the picture's (width, height). Raises ImageError."""
    levels = read_levels(file)
    return detect_in_levels(levels, target), (int(levels.shape[1]), int(levels.shape[0]))


def detect_in_levels(levels: NDArray[Any], target: Target) -> Detection | DetectionError:
    """The target's detection in grey levels (h, w) of 8 or 16 bits, or why there is none."""
    from calibration.detection.detect import detect  # needed by runs only

    failure: DetectionError | None = None
    for image in _exposures(levels):
        try:
            return detect(image, target)
        except DetectionError as error:
            failure = failure or error
    assert failure is not None
    return failure


def _exposures(levels: NDArray[Any]) -> Iterator[NDArray[np.uint8]]:
    """The picture as uint8: as it is; of 16 bits also brighter ones, for a target in the dark beside something bright.

    Brighter ones come last: they cut off highlights, and black-and-white edges move where they do.
    """
    yield to_8_bit(levels)
    if levels.dtype == np.uint8:
        return
    white = content_white(levels)
    for level in np.percentile(levels[::8, ::8], BRIGHT_PERCENTILES):
        if 0 < level < white / 2:
            white = int(level)
            yield to_8_bit(levels, white)
