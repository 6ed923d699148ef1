"""Hypotheses that the views agree in groups which a shift along one line parts: a track that the poses leave out.

A shift does not turn anything, so that X's rotation is known from all views. With it the target's place is
q_i + R_i v - w = u_g in view i, where R_i turns the flange into the base, v is the part of X or of the target's pose
that the flange carries, w the one that stands in the cell, and u_g the shift of the view's group. Three views of one
group give v, by which all others fall into their groups. Such three are drawn at random (M. A. Fischler & R. C. Bolles,
Communications of the ACM 24(6), 1981), and the split whose groups scatter least is kept.
"""

from collections.abc import Iterator
from math import comb

import numpy as np

from calibration.closed_forms.kronecker import kronecker
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Labels
from calibration.diagnosis.hypothesis import Hypothesis
from calibration.diagnosis.view_hypotheses import MIN_VIEWS_FOR_CHANGE, MIN_VIEWS_PER_SIDE
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array

MAX_GROUPS = 4
MIN_VIEWS_PER_GROUP = 3
"""Least views a group on the average; each has at least MIN_VIEWS_PER_SIDE."""

MIN_STEP_MM = 50.0
"""Tracks are moved by more; what slipped in the cell, or an arm in another posture, is off by less."""

DRAWS, REFINEMENTS = 300, 3


def group_hypotheses(evidence: Evidence, sample: Evidence) -> Iterator[Hypothesis]:
    """The best split of all views into each number of groups, as a hypothesis about the `sample` of them."""
    n = len(evidence)
    if n < MIN_VIEWS_FOR_CHANGE:
        return
    X = kronecker(evidence.anchor_T_mount(), evidence.camera_T_target)
    turned, places = evidence.base_T_flange[:, :3, :3], evidence.base_T_flange[:, :3, 3]
    seen = evidence.camera_T_target[:, :3, 3] @ X[:3, :3].T
    places = places - seen if evidence.setup == "eye-to-hand" else places + (turned @ seen[..., None])[..., 0]
    for groups in range(2, min(MAX_GROUPS, n // MIN_VIEWS_PER_GROUP) + 1):
        labels, shifts_mm = _best_split(turned, places, groups)
        direction = np.linalg.svd(shifts_mm - shifts_mm.mean(axis=0))[2][0]
        # Where the arm has moved on, what it sees seems to have moved back.
        direction *= np.sign((shifts_mm[0] - shifts_mm[1]) @ direction)
        at_mm = (shifts_mm[0] - shifts_mm) @ direction
        if np.diff(np.sort(at_mm)).min() < MIN_STEP_MM or np.bincount(labels).min() < MIN_VIEWS_PER_SIDE:
            continue
        poses = sample.base_T_flange.copy()
        poses[:, :3, 3] += np.outer(at_mm[labels[np.searchsorted(evidence.indices, sample.indices)]], direction)
        members = [evidence.indices[labels == group].tolist() for group in range(groups)]
        changes = int(np.count_nonzero(np.diff(labels)))
        yield Hypothesis(
            "track-not-declared",
            tuple(views[0] for views in members),
            sample.with_robot_poses(poses),
            sample,
            Sentence(
                "track-not-declared",
                groups=[Sentence("group-of-views", views=views) for views in members],
                at_mm=np.round(at_mm).astype(int).tolist(),
                **dict(zip("xyz", direction.tolist(), strict=True)),
            ),
            Sentence("declare-track"),
            unknowns=groups + 1,
            alternatives=n * comb(n - 1, changes) * (groups - 1) ** changes,
            whole_session=True,
        )


def _best_split(turned: Array, places: Array, groups: int) -> tuple[Labels, Array]:
    """Label (n,) of every view, in the order of the groups' first views, and the shift (groups, 3) of every group."""
    n, rng = len(places), np.random.default_rng(0)
    drawn = np.argsort(rng.random((DRAWS, n)), axis=1)[:, :3]
    share = np.zeros((DRAWS, 1, n))
    share[np.arange(DRAWS)[:, None], 0, drawn] = 1.0
    for _ in range(REFINEMENTS):
        where = places + (turned @ _carried(turned, places, share)[:, None, :, None])[..., 0]  # (t, n, 3)
        # Part them at the widest gaps along their longest axis.
        off = where - where.mean(axis=1, keepdims=True)
        along = (off @ np.linalg.svd(np.swapaxes(off, 1, 2) @ off)[2][:, 0, :, None])[..., 0]
        order = np.argsort(along, axis=1)
        widest = np.argsort(-np.diff(np.take_along_axis(along, order, axis=1), axis=1), axis=1)[:, : groups - 1]
        starts, labelled = np.zeros((2, DRAWS, n), np.intp)
        np.put_along_axis(starts, widest + 1, 1, axis=1)
        np.put_along_axis(labelled, order, np.cumsum(starts, axis=1), axis=1)
        share = (labelled[:, None] == np.arange(groups)[:, None]).astype(float)
        means = _means(share, where)
        scatter = np.sum((where - np.swapaxes(share, 1, 2) @ means) ** 2, axis=(1, 2))
    best = int(np.argmin(scatter))
    labels, order = np.argmax(share[best], axis=0), np.argsort(np.argmax(share[best], axis=1))
    return np.argsort(order)[labels], means[best][order]


def _means(share: Array, values: Array) -> Array:
    """Mean (t, g, ...) of values (n or t, n, ...) in each group; `share` (t, g, n) is 1 where a view belongs to it."""
    mean: Array = share @ values / np.maximum(share.sum(axis=-1, keepdims=True), 1.0)
    return mean


def _carried(turned: Array, places: Array, share: Array) -> Array:
    """v (t, 3) of least squares, with a mean of their own for the views of each group."""
    t, groups, n = share.shape
    count, used = share.sum(axis=-1)[..., None, None], share.sum(axis=1)
    turn = _means(share, turned.reshape(n, 9)).reshape(t, groups, 3, 3)
    place = _means(share, places)[..., None]
    back = np.swapaxes(turn, -1, -2)
    normal = (count * (np.eye(3) - back @ turn)).sum(axis=1)
    own = used @ (np.swapaxes(turned, 1, 2) @ places[..., None])[..., 0]
    right_hand = (count * (back @ place)).sum(axis=1)[..., 0] - own
    carried: Array = (np.linalg.pinv(normal, rcond=1e-9, hermitian=True) @ right_hand[..., None])[..., 0]
    return carried
