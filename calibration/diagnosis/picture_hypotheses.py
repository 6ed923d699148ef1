"""Hypotheses that the pictures are mirrored, or turned from some view on."""

from collections.abc import Iterator, Sequence

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import fit
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, inverse, rotation_angle_rad, rotation_from_vector, transform

MIRROR = np.diag([-1.0, 1.0, 1.0])
TURNS_DEG = (180, 90, -90)
"""A picture turned by 90 degrees has its sides exchanged, which only a square one survives."""

MAX_TILT_RAD, MAX_SHIFT_MM = 0.02, 10.0
"""Rotation and translation that such a turn may leave of a change of X: 50 px of a usual lens, and noise."""


def mirrored_hypothesis(evidence: Evidence) -> Hypothesis:
    """All pictures are mirrored, at whichever axis: the axes differ by turns, which X takes up.

    A mirrored picture of a plane shows M @ camera_T_target of its points, M = diag(-1, 1, 1). With the plane's normal
    reversed as well this is a rigid transform, and the detected pose.
    """
    flip = np.diag([1.0, 1.0, -1.0])
    rotations = MIRROR @ evidence.camera_T_target[:, :3, :3] @ flip
    places = evidence.camera_T_target[:, :3, 3] @ MIRROR
    # Rotation vectors are turned by a mirror as by its rotation -M.
    by_mirror = np.kron(np.diag([1.0, 0.0]), -MIRROR) + np.kron(np.diag([0.0, 1.0]), MIRROR)
    return Hypothesis(
        "pictures-mirrored",
        (),
        evidence.with_images(transform(rotations, places), by_mirror @ evidence.covariance @ by_mirror),
        evidence,
        Sentence("pictures-mirrored"),
        Sentence("undo-pictures-mirrored"),
        whole_session=True,
    )


def turned_hypotheses(evidence: Evidence, points: Sequence[int]) -> Iterator[Hypothesis]:
    """From each of the `points` (rows) on the pictures are turned by a half or a quarter of a turn."""
    for degrees in TURNS_DEG:
        poses, covariance = _turned(evidence, np.radians(degrees))
        for point in points:
            where, rows = int(evidence.indices[point]), np.arange(len(evidence)) >= point
            corrected = evidence.with_images(
                np.where(rows[:, None, None], poses, evidence.camera_T_target),
                np.where(rows[:, None, None], covariance, evidence.covariance),
            )
            yield Hypothesis(
                "pictures-turned",
                (where,),
                corrected,
                evidence,
                Sentence("pictures-turned", view=where, angle_deg=abs(degrees)),
                Sentence("undo-pictures-turned"),
                alternatives=len(TURNS_DEG) * len(evidence),
                whole_session=True,
            )


def turned_instead(change: Hypothesis) -> Hypothesis:
    """The hypothesis that pictures are turned in place of a change of X that is just that, else the `change`.

    A camera is not moved by a half or a quarter of a turn about its axis, and not at all otherwise.
    """
    if change.x_labels is None:
        return change
    (point,) = np.flatnonzero(change.evidence.indices == change.where[0])
    for turned in turned_hypotheses(change.evidence, [int(point)]):
        before, after = fit(turned.evidence, change.x_labels).mount_T_camera
        between = inverse(before) @ after
        if np.linalg.norm(between[:3, 3]) < MAX_SHIFT_MM and rotation_angle_rad(between[:3, :3]) < MAX_TILT_RAD:
            return turned
    return change


def _turned(evidence: Evidence, angle_rad: float) -> tuple[Array, Array]:
    """Poses (n, 4, 4) and covariances (n, 6, 6) of all views with their pictures turned about the middle, or, where
    there are no pictures, about the camera's axis."""
    if evidence.pictures is not None:
        return evidence.pictures.turned(evidence, angle_rad)
    turn = rotation_from_vector(np.array([0.0, 0.0, angle_rad]))
    both = np.kron(np.eye(2), turn)
    return transform(turn, np.zeros(3)) @ evidence.camera_T_target, both @ evidence.covariance @ both.T
