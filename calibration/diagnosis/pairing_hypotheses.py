"""Hypotheses that images and poses were paired in another order: shifted, lexical, reversed, two blocks swapped."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.diagnosis.angle_agreement import angles_between, angles_between_images
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.sentences.sentence import Sentence

MIN_VIEWS = 4
"""Least views that have an image and the pose that a pairing gives it."""

MAX_VIEWS = 60
"""More views are cut to the first so many: every pairing but the lexical one shows in them."""

MAX_SHIFT = 3
"""Rows by which all poses may be off."""

MAX_PAIRINGS = 20
"""Pairings fitted in full: those that agree best in the angles between views."""

MIN_MISMATCH_RAD = float(np.radians(1.0))
"""RMS mismatch of the angles between views that a pairing may leave in any case: poor robots do."""

MAX_MISMATCH_SHARE = 0.5
"""Share of the mismatch as paired that another pairing may leave."""


@dataclass(frozen=True, eq=False)
class Pairing:
    """`pose_of` (n,): the row of the pose at which each row's image was taken; -1 where that is not in the session."""

    code: str
    where: tuple[int, ...]
    message: str
    fix: str
    pose_of: NDArray[np.intp]


def pairing_hypotheses(evidence: Evidence, views: int) -> list[Hypothesis]:
    """The pairings of the session's `views` that agree best in the angles between views.

    Where neighbouring views have one orientation, angles do not show that they were exchanged, and do not exclude it.
    """
    last = min(views, MAX_VIEWS)
    row_of = np.full(views, -1, np.intp)
    row_of[evidence.indices] = np.arange(len(evidence))
    robot, seen = angles_between(evidence.base_T_flange[:, :3, :3]), angles_between_images(evidence.camera_T_target)
    pairings = list(pairings_of(views, last))
    found: list[tuple[float, Hypothesis]] = []
    for pairing in pairings:
        images = np.flatnonzero((pairing.pose_of >= 0) & (row_of[: len(pairing.pose_of)] >= 0))
        poses = row_of[pairing.pose_of[images]]
        images, poses = row_of[images[poses >= 0]], poses[poses >= 0]
        if len(images) < MIN_VIEWS:
            continue
        off = (robot[np.ix_(rows, rows)] - seen[np.ix_(images, images)] for rows in (poses, images))
        left, given = (float(np.sqrt(np.mean(angles**2))) for angles in off)
        if left > max(MAX_MISMATCH_SHARE * given, MIN_MISMATCH_RAD):
            continue
        baseline = evidence.take(images)
        corrected = baseline.with_robot_poses(evidence.base_T_flange[poses])
        hypothesis = Hypothesis(
            pairing.code, pairing.where, corrected, baseline, pairing.message, pairing.fix,
            alternatives=len(pairings), whole_session=True,
        )  # fmt: skip
        found.append((left, hypothesis))
    return [hypothesis for _, hypothesis in sorted(found, key=lambda one: one[0])[:MAX_PAIRINGS]]


def pairings_of(views: int, last: int) -> Iterator[Pairing]:
    """Every pairing of `views` rows, of which the first `last` are compared; the lexical ones compare all."""
    rows = np.arange(last)
    for shift in range(-MAX_SHIFT, MAX_SHIFT + 1):
        if abs(shift) > 1:
            yield Pairing(
                "poses-off-by-one",
                (),
                Sentence("poses-off-by", rows=abs(shift), shift=shift),
                Sentence("pair-images-first-rows"),
                _within(rows + shift, views),
            )
    for start in range(2, last - 2):
        for shift, sentence_id in ((1, "image-lost-from"), (-1, "pose-lost-from")):
            pose_of = np.where(rows < start, rows, rows + shift)
            if shift < 0:
                pose_of[start] = -1  # the image whose pose was lost
            yield Pairing(
                "poses-shifted",
                (start,),
                Sentence(sentence_id, view=start),
                Sentence("pair-images-from", view=start),
                _within(pose_of, views),
            )
    yield Pairing("poses-reversed", (), Sentence("poses-reversed"), Sentence("reverse-order"), views - 1 - rows)
    for first in (0, 1):
        by_name = np.array(sorted(range(views), key=lambda row: str(row + first)), np.intp)
        for pose_of, what in ((by_name, "images"), (np.argsort(by_name), "poses")):
            if np.any(pose_of != np.arange(views)):
                yield Pairing(
                    "poses-in-lexical-order",
                    (),
                    Sentence(f"{what}-in-lexical-order", first=first),
                    Sentence("sort-by-number"),
                    pose_of,
                )
    for start in range(2, last - 1):
        if views <= MAX_VIEWS:
            yield Pairing(
                "poses-blocks-swapped",
                (views - start,),
                Sentence("poses-blocks-swapped", poses=views - start),
                Sentence("order-as-taken"),
                (rows + start) % views,
            )


def _within(rows: NDArray[np.intp], views: int) -> NDArray[np.intp]:
    """The rows, with -1 for those outside the session."""
    return np.where((rows >= 0) & (rows < views), rows, -1)
