"""Detection of the target in a view's picture, for folders that are read and folders that are being written.

Whether the pictures of a session show another target than described.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey
from calibration.errors import DetectionError
from calibration.problem import Detection, View
from calibration.sentences.sentence import Sentence, with_fix
from calibration.targets import Target
from daemon.sessions.session_files import read_levels
from drivers.cameras.pixel_depth import content_white, to_8_bit

if TYPE_CHECKING:
    from calibration.detection.recognition import Alternative

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


MAX_FOUND_SHARE = 1 / 3
"""With more of the pictures showing the target, its description is right."""
MAX_PICTURES = 3
"""Pictures in which alternatives are searched, a second or less each."""
DESCRIPTION_CODES = frozenset({"not-found", "other-board", "not-planar", "too-few-points", "origin-not-found"})
"""Reasons that a wrong description may have."""


def explain_missing(views: Sequence[View], target: Target, read: Callable[[str], Grey]) -> list[View]:
    """The views; where the target was not found, with the description that fits most of the pictures looked at.

    `read` gives an image by its name. Nothing is searched when the target was found in more than MAX_FOUND_SHARE.
    """
    pictures = [view for view in views if view.image is not None]
    missed = [view for view in pictures if view.missing is not None and view.missing[0] in DESCRIPTION_CODES]
    found = sum(view.detection is not None for view in pictures)
    if not missed or found > MAX_FOUND_SHARE * len(pictures):
        return list(views)
    step = max(1, len(missed) // MAX_PICTURES)
    looked_at = [read(view.image or "") for view in missed[::step][:MAX_PICTURES]]
    from calibration.detection.recognition import find_alternative  # the detector is needed by runs only

    alternatives = [find_alternative(picture, target) for picture in looked_at]
    seen = [alternative for alternative in alternatives if alternative is not None]
    if 2 * len(seen) <= len(looked_at):
        return list(views)
    best = max(seen, key=lambda one: sum(other.target == one.target for other in seen))
    return [_explained(view, best) if view in missed else view for view in views]


def _explained(view: View, alternative: "Alternative") -> View:
    assert view.missing is not None
    code, sentence = view.missing
    what = sentence.params.get("what", sentence) if isinstance(sentence, Sentence) else sentence
    error = alternative.error(DetectionError(code, what, ""))
    return replace(view, missing=(code, with_fix(error.what, error.fix)))
