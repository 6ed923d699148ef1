"""The kinds of fault that the diagnosis is measured on: how to make one of any size, and where it begins to stand out.

Sizes are counted from where a fault of that kind begins to stand above the noise of that very session: where an oracle
that is told the kind, and tries all views, is right in 99 of 100 such sessions (`tests.simulated.detectable_faults`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from calibration.diagnosis.convention_hypotheses import MIN_SCALE_ERROR
from calibration.problem import Problem
from calibration.transforms import Array
from tests.simulated.detectable_faults import Reach, lens_reach, mistyped_reach, moved_reach, scale_reach
from tests.simulated.faults import (
    CONVENTIONS,
    Fault,
    Noise,
    Slip,
    distortion_wrong,
    focal_wrong,
    in_convention,
    mistyped,
    moved,
    other_tool,
    scaled_target,
    sign_lost,
    swapped,
    track_left_out,
    turned,
)

Put = Callable[[Problem, np.random.Generator], Fault]
GROSS: dict[str, Put] = {
    **{code: in_convention(code) for code in CONVENTIONS},
    "two poses swapped": swapped,
    "a quaternion's sign": sign_lost,
    "board turned in one view": turned,
    "tool instead of flange from view k on": other_tool,
    "on a track that poses leave out": track_left_out,
}
FOCAL, K1 = np.repeat([1.0, 0.0], [2, 7]), np.eye(9)[4]

LEAST_MM = 0.1
"""Ten times what the best robots repeat: less is no fault, however exact a simulated robot is."""

LEAST_SHARE = 2 * MIN_SCALE_ERROR
"""Of the target's size: less is paper that breathes."""


@dataclass(frozen=True, eq=False)
class Session:
    """`noise`: the true levels, None for a real one; `before`: what is said of it while nothing is wrong;

    `turned_back`: the views, fewer than one in five, that the arm took with axis 1 turned back.
    """

    problem: Problem
    noise: Noise | None
    before: frozenset[str] = frozenset()
    turned_back: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Kind:
    """How to make a fault of any size, and where it stands above a session's noise."""

    slip_of: Callable[[Problem, np.random.Generator], Slip]
    reach: Callable[[Session, Slip], Reach]
    real: bool = True


def _lens(change: Array, session: Session, _: Slip) -> Reach:
    camera = session.problem.camera
    assert camera is not None and session.noise is not None
    focal = np.array([camera.matrix[0, 0], camera.matrix[1, 1], *np.ones(7)])
    return lens_reach(session.problem, change * focal, session.noise.image_px)


def _by(reach: Callable[[Problem, Slip, Noise | None], Reach], least: float = 0.0) -> Callable[[Session, Slip], Reach]:
    def above_noise(session: Session, slip: Slip) -> Reach:
        found = reach(session.problem, slip, session.noise)
        return replace(found, least=least / found.deviation)

    return above_noise


KINDS = {
    "one number of a position mistyped": Kind(mistyped, _by(mistyped_reach, LEAST_MM)),
    "base side moved at view k": Kind(partial(moved, what="base"), _by(moved_reach, LEAST_MM)),
    "flange side moved at view k": Kind(partial(moved, what="tool"), _by(moved_reach, LEAST_MM)),
    "pitch": Kind(scaled_target, _by(scale_reach, LEAST_SHARE)),
    "focal length": Kind(focal_wrong, partial(_lens, FOCAL), real=False),
    "distortion k1": Kind(distortion_wrong, partial(_lens, K1), real=False),
}
