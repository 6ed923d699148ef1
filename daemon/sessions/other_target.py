"""Whether the pictures of a session show another target than described."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from calibration.detection.image import Grey
from calibration.errors import DetectionError
from calibration.problem import View
from calibration.sentences.sentence import Sentence, with_fix
from calibration.targets import Target

if TYPE_CHECKING:
    from calibration.detection.recognition import Alternative

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
