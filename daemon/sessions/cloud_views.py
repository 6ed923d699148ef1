"""Views that are organised clouds: the target is found in their intensity and measured in their points."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.detection.cloud_points import measure_corners
from calibration.documents.session import ViewDocument
from calibration.errors import DetectionError
from calibration.problem import View
from calibration.sentences.sentence import with_fix
from calibration.targets import Target
from drivers.cameras.pixel_depth import to_8_bit
from registration.io.organised import read_organised

BRIGHT_PERCENTILES = (99.9, 95.0)
"""Grey levels of an intensity without a range of its own that become white, one after the other."""


def view_of_cloud(folder: Path, target: Target, index: int, view: ViewDocument, size: tuple[int, int] | None) -> View:
    """The view with the target's points in space, or with the reason why there are none.

    `size`: width and height, for files that do not hold them. Raises CloudError's leaves, UnitUnknown.
    """
    from calibration.detection.detect import detect  # needed by runs only

    assert view.cloud is not None
    assert view.unit is not None
    cloud = read_organised(folder / view.cloud, view.unit, size)
    failure: DetectionError | None = None
    for image in _exposures(cloud.intensity):
        try:
            return View(
                index, view.stance, None, view.cloud, measured=measure_corners(detect(image, target), cloud.points_mm)
            )
        except DetectionError as error:
            failure = failure or error
    assert failure is not None
    return View(index, view.stance, None, view.cloud, missing=(failure.code, with_fix(failure.what, failure.fix)))


def _exposures(intensity: NDArray[Any]) -> list[NDArray[np.uint8]]:
    """The intensity as uint8: integers by their depth, other numbers by what is bright."""
    if intensity.dtype in (np.uint8, np.uint16):
        return [to_8_bit(intensity)]
    levels = np.nan_to_num(intensity.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    dark = float(np.percentile(levels, 0.1))
    whites = [float(np.percentile(levels, percentile)) for percentile in BRIGHT_PERCENTILES]
    scaled = [255 * (levels - dark) / max(white - dark, 1e-12) for white in whites]
    return [np.clip(image, 0, 255).astype(np.uint8) for image in scaled]
