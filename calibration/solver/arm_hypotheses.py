"""What may explain the views of a target: groups of the arm's errors, how large they are, and a target of another size.

An estimate without errors of the arm takes them for what is left to it, a target of another size or a principal point
that is off. Where it has taken up one of these, every group is tried with it and with target and camera as described.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.arm_errors import LADDER, Group, Postures
from calibration.likelihood.mixed_model import MixedModel, Variances
from calibration.likelihood.noise_marginalisation import restricted_log_likelihood
from calibration.likelihood.shared_columns import fix_unknowns, with_arm
from calibration.likelihood.variance_components import estimate_variances
from calibration.solver.arm_session import ArmSession
from calibration.transforms import Array

SCALES = (0.15, 0.4, 1.0, 2.0)
"""Of the parameters' standard deviations; each has the same prior probability."""

PRIOR_OFF_PROBABILITY = 0.1
"""Prior probability that the target's size is off, where that was found without errors of the arm."""

SIZE_SIGMA = 2e-3
"""Standard deviation of a target's size that is off, as a share: printers and paper."""

NEXT_GROUP_PROBABILITY = 0.9
"""Prior probability that an arm with the errors up to one group has those of the next; all have gears and weight."""


@dataclass(frozen=True)
class Hypothesis:
    """The groups `up_to` one, whose deviations are times `scale`; without errors of the arm None and 0.

    Where its temperatures are known the growth by them is among the errors in any case: all arms grow.

    `as_described`: the target's size, not as the estimate without errors of the arm has it.
    """

    up_to: Group | None
    scale: float
    as_described: bool
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
        found[session.poses + self.errors] = (
            b[first:] + self.model.prior_offset[first:] + session.arm.means[self.errors]
        )
        return found

    def target_scale(self, b: Array, session: ArmSession) -> float:
        """Of the target against the description, after a step b (p,)."""
        return 1.0 if self.of.as_described else float(session.best.scale * np.exp(b[session.size_place()]))

    def covariance(self, of_step: Array, session: ArmSession) -> Array:
        """Covariance of `unknowns`, then of lens and target, from that of b (p, p); 0 for a size as described."""
        poses, p, first = session.poses, self.model.unknowns, session.poses + len(session.arm)
        q = len(session.best.z)
        nuisances = np.arange(first, first + q)
        if self.of.as_described:
            nuisances = np.delete(nuisances, session.size_place() - poses)
        own = np.r_[0:poses, p - len(self.errors) : p, poses : p - len(self.errors)]
        among = np.concatenate([np.arange(poses), poses + self.errors, nuisances])
        found = np.zeros((first + q, first + q))
        found[np.ix_(among, among)] = of_step[np.ix_(own, own)]
        return found


def hypotheses(session: ArmSession) -> list[Hypothesis]:
    """Those without errors of the arm first; prior probabilities sum to 1 with errors, and to 1 without."""
    odds = {True: 0.0}
    if session.sized:
        odds = {True: float(np.log(1 - PRIOR_OFF_PROBABILITY)), False: float(np.log(PRIOR_OFF_PROBABILITY))}
    groups = [group for group in LADDER if group != "play" or session.postures.sides is not None]
    known: list[tuple[Group | None, float, float]] = [(None, 0.0, 0.0)]
    for place, group in enumerate(groups):
        last = place + 1 == len(groups)
        share = NEXT_GROUP_PROBABILITY**place * (1.0 if last else 1 - NEXT_GROUP_PROBABILITY) / len(SCALES)
        known += [(group, scale, float(np.log(share))) for scale in SCALES]
    return [
        Hypothesis(group, scale, as_described, log_prior + log_odds)
        for group, scale, log_prior in known
        for as_described, log_odds in odds.items()
    ]


def restrict(
    session: ArmSession, wanted: Sequence[Hypothesis], levels: Sequence[Variances] | None = None
) -> list[Restricted]:
    """The session's model under each hypothesis, at its own noise levels.

    `levels`: where the search for them starts.
    """
    model = _with_prior_size(session, session.linearise())
    others, k = model.unknowns, len(session.arm)
    jacobian = session.arm.jacobian(session.parameters, session.postures)
    from_prior = session.parameters - session.arm.means
    whole = session.add_distances(with_arm(model, jacobian, session.arm.sigmas**-2.0, from_prior))
    found, variances = [], replace(session.best.variances, trend_rotation=0.0, trend_translation=0.0)
    for row, one in enumerate(wanted):
        columns = session.arm.indices(*_groups_of(one, session.postures))
        absent = np.setdiff1d(np.arange(k), columns)
        fixed, steps = others + absent, -session.parameters[absent]
        if one.as_described:
            fixed, steps = np.append(session.size_place(), fixed), np.append(-np.log(session.best.scale), steps)
        known = whole.prior_information.copy()
        known[others + session.arm.indices(*LADDER)] /= max(one.scale, 1e-9) ** 2
        restricted = fix_unknowns(replace(whole, prior_information=known), fixed, steps)
        variances = estimate_variances(restricted, levels[row] if levels else variances)
        found.append(Restricted(one, columns, restricted, variances))
    return found


def _groups_of(one: Hypothesis, postures: Postures) -> tuple[Group, ...]:
    if one.up_to is None:
        return ()
    groups = LADDER[: LADDER.index(one.up_to) + 1]
    return groups if postures.warmth_k is None else (*groups, "warmth")


def _with_prior_size(session: ArmSession, model: MixedModel) -> MixedModel:
    """The model with the prior of the target's size about the described one.

    As wide as targets that are off, or as what was found: a print may be some per cent off.
    """
    place, scale = session.size_place(), session.best.scale
    known, offset = model.prior_information.copy(), model.prior_offset.copy()
    known[place] = max(SIZE_SIGMA, abs(scale - 1)) ** -2.0
    offset[place] = np.log(scale)
    return replace(model, prior_information=known, prior_offset=offset)
