"""What may explain the views of a target: groups of the arm's errors, and how large they are.

Target and lens are unknown in each of them. Without errors of the arm the target's size is against its millimetre, with
what errors may do to that (`ARM_SHARE`); with them it is against the true one, in which points are placed then.

What does not belong together (another arm, a camera that was remounted, a target or a base that moved) is a constant
change of some views' poses beside the errors of one arm: of those of one session, or of those from one view on. All are
tried at the noise levels of the likeliest model with errors of the arm, by the closed form of the evidence; the best of
each kind is compared with that model at noise levels of its own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calibration.errors import CalibrationError
from calibration.kinematics.arm_errors import Group
from calibration.knowledge import PriorMixture
from calibration.likelihood.mixed_model import MixedModel, Variances, solve, with_arm
from calibration.likelihood.noise_marginalisation import restricted_log_likelihood
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import covariance_of
from calibration.transforms import Array, adjoint, inverse, map_points
from extensions.arm_identification.mathematics.linear_models import fix_unknowns
from extensions.arm_identification.mathematics.session import ArmSession

LADDER: tuple[Group, ...] = ("zeros", "links", "gears", "sag", "rest", "play")
"""From what explains most in ordinary arms to what explains least; a model has the groups up to one of them."""

SCALES = {0.15: 0.1, 0.4: 0.2, 1.0: 0.5, 2.0: 0.2}
"""Of the parameters' means and standard deviations, with prior probabilities: most arms are as delivered."""

NEXT_GROUP_PROBABILITY = 0.98
"""Prior probability that an arm with the errors up to one group has those of the next: all have gears and weight, and
what views do not show of them must stay uncertain."""


@dataclass(frozen=True)
class Hypothesis:
    """The groups `up_to` one, whose deviations are times `scale`; without errors of the arm None and 0.

    Where its temperatures are known the growth by them is among the errors in any case: all arms grow.
    """

    up_to: Group | None
    scale: float
    log_prior: float


@dataclass(frozen=True, eq=False)
class Restricted:
    """The model of a hypothesis, the errors of the arm (e,) that are its last unknowns, and its noise levels."""

    of: Hypothesis
    errors: NDArray[np.intp]
    model: MixedModel
    variances: Variances

    def log_likelihood(self) -> float:
        """Restricted, with the prior of the hypothesis."""
        return restricted_log_likelihood(self.model, self.variances) + self.of.log_prior

    def unknowns(self, b: Array, session: ArmSession) -> Array:
        """The step of X and the places, and all errors of the arm (6 + 6m + k,), after a step b (p,)."""
        first, found = self.model.unknowns - len(self.errors), np.zeros(session.poses + len(session.arm))
        found[: session.poses] = b[: session.poses]
        found[session.poses + self.errors] = b[first:] + session.parameters[self.errors]
        return found

    def covariance(self, of_step: Array, session: ArmSession) -> Array:
        """Covariance of `unknowns`, then of lens and target, from that of b (p, p)."""
        poses, p, whole = session.poses, self.model.unknowns, session.poses + len(session.arm) + len(session.best.z)
        own = np.r_[0:poses, p - len(self.errors) : p, poses : p - len(self.errors)]
        among = np.r_[0:poses, poses + self.errors, whole - len(session.best.z) : whole]
        found = np.zeros((whole, whole))
        found[np.ix_(among, among)] = of_step[np.ix_(own, own)]
        return found


def hypotheses(session: ArmSession) -> list[Hypothesis]:
    """Those without errors of the arm first; prior probabilities sum to 1 with errors, and to 1 without."""
    groups = [group for group in LADDER if group != "play" or session.postures.sides is not None]
    known = [Hypothesis(None, 0.0, 0.0)]
    for place, group in enumerate(groups):
        last = place + 1 == len(groups)
        share = NEXT_GROUP_PROBABILITY**place * (1.0 if last else 1 - NEXT_GROUP_PROBABILITY)
        known += [Hypothesis(group, scale, float(np.log(share * prior))) for scale, prior in SCALES.items()]
    return known


def restrict(
    session: ArmSession, wanted: Sequence[Hypothesis], levels: Sequence[Variances] | None = None
) -> list[Restricted]:
    """The session's model under each hypothesis, at its own noise levels.

    `levels`: where the search for them starts.
    """
    model = session.linearise()
    others, k = model.unknowns, len(session.arm)
    jacobian = session.arm.jacobian(session.parameters, session.postures)
    whole = session.add_distances(with_arm(model, jacobian, session.arm.sigmas**-2.0, session.parameters))
    found, variances = [], replace(session.best.variances, trend_rotation=0.0, trend_translation=0.0)
    for row, one in enumerate(wanted):
        groups = LADDER[: LADDER.index(one.up_to) + 1] if one.up_to else ()
        warmth: tuple[Group, ...] = ("warmth",) if groups and session.postures.warmth_k is not None else ()
        columns = session.arm.indices(*groups, *warmth)
        absent = np.setdiff1d(np.arange(k), columns)
        scales = np.ones(k)
        scales[session.arm.indices(*LADDER)] = max(one.scale, 1e-9)
        known, offset = whole.prior_information.copy(), whole.prior_offset.copy()
        known[others:] /= scales**2
        offset[others:] -= scales * session.arm.means
        mixture = against_true_lengths(whole.mixture) if whole.mixture and one.up_to else whole.mixture
        supposed = replace(whole, prior_information=known, prior_offset=offset, mixture=mixture)
        restricted = fix_unknowns(supposed, others + absent, -session.parameters[absent])
        variances = estimate_variances(restricted, levels[row] if levels else variances)
        found.append(Restricted(one, columns, restricted, variances))
    return found


def against_true_lengths(prior: PriorMixture) -> PriorMixture:
    """The prior where the arm's errors are unknowns of their own: the size is against the true millimetre."""
    information = prior.information.copy()
    information[:, prior.size] /= 1 - prior.arm_share
    return replace(prior, information=information, arm_share=0 * prior.arm_share)


ContradictionKind = Literal["other-arm", "camera-remounted", "camera-moved", "target-or-base-moved"]

MIN_GAIN = 20.0
"""Of log-evidence. An arm whose errors have other forms than the model gains up to 8 by being two arms."""

MIN_MOVE_MM = 0.1
"""At the target; less is in the scatter of an arm."""

MOVE_SIGMAS = np.repeat([1e-3, 1.0], 3)
"""rad, mm: one standard deviation of a camera or target that moved."""

MIN_VIEWS = 3
"""On either side of the view from which something has moved: fewer are single wrong views."""


@dataclass(frozen=True)
class Contradiction:
    """What does not belong together, since the view at a position of the place's session, or in all of the session.

    `log_evidence` of it beside the arm's errors against these alone; `move_mm`: of the target as seen, RMS over views.
    """

    kind: ContradictionKind
    place: int
    position: int | None
    log_evidence: float
    move_mm: float


_SENTENCES: dict[ContradictionKind, str] = {
    "other-arm": "session {session} is of another arm than the others, or a zero or a load was changed: solve it alone",
    "camera-remounted": "the camera sits elsewhere in session {session} than in the others: solve it alone",
    "camera-moved": "the camera moved before picture {view} of session {session}: fasten it, take the pictures again",
    "target-or-base-moved": "the target, or the robot on its base, moved before picture {view} of session {session}:"
    " fasten both, take the pictures again",
}


class SessionsContradict(CalibrationError):
    """Errors of the arm are not taken from views that do not belong together; `found` is what does not.

    `session`: counted from 1; `view`: its number there, from 1.
    """

    def __init__(self, found: Contradiction, session: int, view: int | None) -> None:
        self.found = found
        what = _SENTENCES[found.kind].format(session=session, view=view)
        super().__init__(f"{what} (points of the target differ by {found.move_mm:.1f} mm)")


@dataclass(frozen=True, eq=False)
class _Change:
    """A change of views' poses by `columns` (n, 6, c) with standard deviations (c,), zero but for some of the views."""

    kind: ContradictionKind
    place: int
    first: int | None
    columns: Array
    sigmas: Array


def find_contradiction(session: ArmSession, likeliest: Restricted) -> Contradiction | None:
    """The likeliest one beside the errors of the arm as `likeliest` has them, None where one arm explains the views."""
    score = _Score(likeliest)
    gains = sorted(((score.gain(change), change) for change in _changes(session)), key=lambda pair: pair[0])
    best = {change.kind: (gain, change) for gain, change in gains}
    found = [_measure(session, likeliest, change) for gain, change in best.values() if gain > 0]
    found = [one for one in found if one.log_evidence > MIN_GAIN and one.move_mm > MIN_MOVE_MM]
    return max(found, key=lambda one: one.log_evidence, default=None)


def _changes(session: ArmSession) -> Iterator[_Change]:
    back = adjoint(inverse(np.concatenate([chain.base_T_flange for chain in session.chains])))
    held, apart = np.broadcast_to(np.eye(6), back.shape), back  # what is on the flange, and what stands in the cell
    in_hand = session.views[0].rows.setup == "eye-in-hand"
    of_camera, of_target = (held, apart) if in_hand else (apart, held)
    of_arm = session.arm.jacobian(session.parameters, session.postures)
    for place in range(len(session.views)):
        own = session.places == place
        if len(session.views) > 1:
            yield _Change("other-arm", place, None, of_arm * own[:, None, None], np.sqrt(2) * session.arm.sigmas)
            yield _Change("camera-remounted", place, None, of_camera * own[:, None, None], MOVE_SIGMAS)
        for first in np.flatnonzero(own)[MIN_VIEWS : 1 - MIN_VIEWS]:
            since = (own & (np.arange(len(own)) >= first))[:, None, None]
            yield _Change("camera-moved", place, int(first), of_camera * since, MOVE_SIGMAS)
            yield _Change("target-or-base-moved", place, int(first), of_target * since, MOVE_SIGMAS)


class _Score:
    """The gain of log-evidence by changes, at the noise levels without them."""

    def __init__(self, of: Restricted) -> None:
        model, levels = of.model, of.variances
        step, p = solve(model, levels), model.unknowns
        own = covariance_of(model.UU)
        self._covariance = step.covariance
        self._weights = np.linalg.inv(levels.pixel * own + np.diag(levels.deviations() ** 2))
        self._shared = own @ model.UAy[:, :, :p]
        self._off = (self._shared @ step.b + (own @ model.UAy[:, :, p, None])[..., 0])[..., None]

    def gain(self, change: _Change) -> float:
        some = np.any(change.columns, axis=(1, 2))
        columns = change.columns[some] * change.sigmas
        weighed = self._weights[some] @ columns
        across = np.einsum("nij,nik->jk", self._shared[some], weighed)
        information = np.einsum("nij,nik->jk", columns, weighed) - across.T @ self._covariance @ across
        gradient = np.einsum("nij,nik->jk", weighed, self._off[some])[:, 0]
        whole = np.eye(len(information)) + information
        return float(0.5 * gradient @ np.linalg.solve(whole, gradient) - 0.5 * np.linalg.slogdet(whole)[1])


def _measure(session: ArmSession, likeliest: Restricted, change: _Change) -> Contradiction:
    """The change at noise levels of its own."""
    c = len(change.sigmas)
    model = with_arm(likeliest.model, change.columns, change.sigmas**-2.0, np.zeros(c))
    levels = estimate_variances(model, likeliest.variances)
    gain = restricted_log_likelihood(model, levels) + likeliest.of.log_prior - likeliest.log_likelihood()
    moved = (change.columns @ solve(model, levels).b[-c:])[np.any(change.columns, axis=(1, 2))]
    middle = session.views[0].rows.nominal_mm.mean(axis=0, keepdims=True)
    at = np.concatenate([map_points(chain.flange_T_target(), middle)[:, 0] for chain in session.chains])
    by = moved[:, 3:] + np.cross(moved[:, :3], at[np.any(change.columns, axis=(1, 2))])
    position = None
    if change.first is not None:
        before = int(np.flatnonzero(session.places == change.place)[0])
        position = int(session.views[change.place].rows.seen.positions[change.first - before])
    return Contradiction(change.kind, change.place, position, gain, float(np.sqrt(np.mean(np.sum(by**2, axis=1)))))
