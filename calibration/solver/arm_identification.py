"""The arm's errors identified with X and the target's places, by the restricted likelihood of the session.

Each model has the groups of errors up to one of them, and their standard deviations times one scale: a calibrated arm's
are a tenth of a new arm's. Estimates and covariance are averaged over the models by their evidence, so that what views
cannot decide stays uncertain. The errors are taken up where the evidence of all models together is above that of no
error by MIN_LOG_EVIDENCE, and views left out by region of joint space are predicted no worse.
Source of the evidence: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.errors import CalibrationError
from calibration.kinematics.arm_errors import GROUPS, MAX_USUAL_SIGMAS, ArmErrorModel, Group, Postures
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate, exact_pixels, linearise
from calibration.likelihood.leave_groups_out import split
from calibration.likelihood.mapped_points import point_rows
from calibration.likelihood.mixed_model import MixedModel, Variances, solve
from calibration.likelihood.noise_marginalisation import Marginal, marginalise, restricted_log_likelihood
from calibration.likelihood.shared_columns import fix_unknowns, join_places, take_views, with_arm
from calibration.likelihood.systematic_errors import SystematicErrors
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import inverse_or_pseudo_inverse
from calibration.observations.observations import scale_target
from calibration.observations.view_poses import refine_poses
from calibration.preprocessing.prepare import PreparedSession
from calibration.problem import Setup, anchor_T_mount_of
from calibration.solver.arm_view_selection import select_views_with_arm
from calibration.transforms import Array, inverse, map_points, transform_from_vector

SCALES = (0.15, 0.4, 1.0, 2.0)
"""Of the parameters' standard deviations; each has the same prior probability."""

MIN_LOG_EVIDENCE = 5.0
"""Exceeded by chance in less than one of 140 perfect arms (Markov's inequality)."""

MAX_HOLD_OUT_RATIO = 1.0
REGIONS, MIN_REGION_VIEWS = 6, 3
"""Groups of neighbours in joint space that are left out in turn."""

MAX_LOG_DEFICIT = 8.0
"""Models whose log-likelihood is this far below the best are not averaged."""


@dataclass(frozen=True)
class LadderRow:
    """The models up to one group: probability; gain of log-evidence over no error, hold-out, scale of the likeliest."""

    up_to: Group | None
    probability: float
    log_evidence: float
    hold_out_mm: float
    scale: float


@dataclass(frozen=True, eq=False)
class ArmViews:
    """The views that agree, one place after the other: postures, camera_T_target (n, 4, 4), and the camera."""

    setup: Setup
    postures: Postures
    camera_T_target: Array
    camera: CameraModel


@dataclass(frozen=True, eq=False)
class ArmFit(ArmEstimate):
    """What sessions say about the arm.

    taken_up : whether its errors enter X and poses.
    log_evidence : of errors of the arm against none, over all models.
    anchor_T_target : (m, 4, 4) of the target's places.
    covariance_with_places : (6 + 6m + k, 6 + 6m + k) of [X, the places of the target, the parameters].
    views : number of those that agree.
    seen : those views.
    """

    taken_up: bool
    views: int
    log_evidence: float
    anchor_T_target: Array
    covariance_with_places: Array
    variances: Variances
    seen: ArmViews
    ladder: tuple[LadderRow, ...]

    def beyond_usual(self) -> list[str]:
        """Names of parameters above MAX_USUAL_SIGMAS, the largest first: no arm's errors."""
        sizes = np.abs(self.parameters) / self.model.sigmas
        return [self.model.parameters[row].name for row in np.argsort(-sizes) if sizes[row] > MAX_USUAL_SIGMAS]


class UnusualArm(CalibrationError):
    """The views ask for errors that no arm has: `parameters` by name, the largest first."""

    def __init__(self, arm: str, parameters: list[str]) -> None:
        self.arm, self.parameters = arm, parameters
        super().__init__(
            f"the views ask for errors that no {arm} has ({', '.join(parameters[:3])}): check that the target stood"
            " still, its size, and the zeros of the axes (revolution counters, a new motor)"
        )


@dataclass(frozen=True, eq=False)
class _Restricted:
    """The model with the groups `up_to` one, whose deviations are times `scale`: parameters `columns`, noise levels."""

    up_to: Group | None
    scale: float
    columns: NDArray[np.intp]
    model: MixedModel
    variances: Variances


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A model with its marginal over the noise levels."""

    of: _Restricted
    marginal: Marginal


@dataclass(frozen=True, eq=False)
class TargetViews:
    """The views of the target at one place, and the estimate without errors of the arm from the `used` (n,) ones."""

    rows: PreparedSession
    used: NDArray[np.bool_]
    best: Estimate

    def camera_T_target(self) -> Array:
        """Each view's own pose (n, 4, 4), by the estimated camera."""
        seen = scale_target(self.rows.seen, self.best.scale)
        poses = refine_poses(seen, self.best.camera, self.rows.camera_T_target)
        poses[self.used] = self.best.chain.camera_T_target()
        return poses

    def take(self, chosen: NDArray[np.bool_]) -> "TargetViews":
        """Only the chosen views; all of them are used."""
        return replace(self, rows=self.rows.take(chosen), used=np.ones(int(np.count_nonzero(chosen)), bool))


@dataclass(frozen=True, eq=False)
class _Session:
    """The views of one place after the other, with their chains, and the errors that the chains' poses contain."""

    arm: ArmErrorModel
    postures: Postures
    views: Sequence[TargetViews]
    chains: Sequence[Chain]
    parameters: Array

    @property
    def places(self) -> NDArray[np.intp]:
        """The place (n,) of each view."""
        return np.repeat(np.arange(len(self.views)), [len(one.rows.seen) for one in self.views])

    @property
    def used(self) -> NDArray[np.bool_]:
        """(n,)"""
        return np.concatenate([one.used for one in self.views])

    def take(self, chosen: NDArray[np.bool_]) -> "_Session":
        """Only the chosen views."""
        masks = [chosen[self.places == place] for place in range(len(self.views))]
        chains = [
            replace(chain, base_T_flange=chain.base_T_flange[mask], corrections=chain.corrections[mask])
            for chain, mask in zip(self.chains, masks, strict=True)
        ]
        views = [one.take(mask) for one, mask in zip(self.views, masks, strict=True)]
        return replace(self, postures=self.postures.take(chosen), views=views, chains=chains)

    @property
    def best(self) -> Estimate:
        """The estimate from the first place."""
        return self.views[0].best


def identify_arm(arm: ArmErrorModel, views: Sequence[TargetViews], postures: Postures) -> ArmFit:
    """The arm's errors from views of the target at one place or several, which need not be known.

    `views`: the place with most views first; camera and noise levels start from its estimate. `postures`: of all views,
    one place after the other.
    """
    session = _select(_begin(arm, views, postures))
    restricted = _restrict(session, _ladder(postures))
    logs = _log_likelihoods(restricted)
    likely = [one for one, log in zip(restricted[1:], logs[1:], strict=True) if log > logs[1:].max() - MAX_LOG_DEFICIT]
    first = np.mean([_parameters_of(one, solve(one.model, one.variances).b, len(arm)) for one in likely], axis=0)
    session = _move(session, first)
    candidates = [restricted[0], *likely]
    again = _restrict(session, [(one.up_to, one.scale) for one in candidates], [one.variances for one in candidates])
    found = [_Candidate(one, marginalise(one.model, one.variances)) for one in again]
    return _conclude(session, found, len(restricted) - 1)


def _select(session: _Session) -> _Session:
    """Only the views that the likeliest model explains, beginning with those used without errors of the arm."""
    ladder = _ladder(session.postures)
    restricted = _restrict(session.take(session.used), ladder)
    likeliest = int(np.argmax(_log_likelihoods(restricted)))
    (whole,) = _restrict(session, [ladder[likeliest]], [restricted[likeliest].variances])
    return session.take(select_views_with_arm(whole.model, restricted[likeliest].variances, session.used))


def _log_likelihoods(restricted: Sequence[_Restricted]) -> Array:
    return np.array([restricted_log_likelihood(one.model, one.variances) for one in restricted])


def _ladder(postures: Postures) -> list[tuple[Group | None, float]]:
    known = [group for group in GROUPS if (group != "play" or postures.sides is not None)]
    known = [group for group in known if (group != "warmth" or postures.warmth_k is not None)]
    return [(None, 0.0), *((group, scale) for group in known for scale in SCALES)]


def _begin(arm: ArmErrorModel, views: Sequence[TargetViews], postures: Postures) -> _Session:
    """The session at the drawing; X is that of the first place, and every target where its first view has it."""
    drawn = np.split(arm.forward(np.zeros(len(arm)), postures), np.cumsum([len(one.rows.seen) for one in views])[:-1])
    x, chains = views[0].best.chain.mount_T_camera, []
    for one, base_T_flange in zip(views, drawn, strict=True):
        seen_T = one.camera_T_target()
        target = one.best.chain.anchor_T_target
        if one is not views[0]:
            first = np.flatnonzero(one.used)[:1]
            target = (anchor_T_mount_of(one.rows.setup, base_T_flange[first]) @ x @ seen_T[first])[0]
        chain = Chain(one.rows.setup, base_T_flange, x, target, np.zeros((len(seen_T), 6)))
        chains.append(chain.with_corrections_from(seen_T))
    return _Session(arm, postures, views, chains, np.zeros(len(arm)))


def _restrict(
    session: _Session, wanted: list[tuple[Group | None, float]], levels: list[Variances] | None = None
) -> list[_Restricted]:
    """The session's model with each of the wanted groups and scales, at its own noise levels.

    `levels`: where the search for them starts.
    """
    best = session.best
    model = join_places(
        [_linearised(one, chain, best) for one, chain in zip(session.views, session.chains, strict=True)]
    )
    others = model.unknowns
    jacobian = session.arm.jacobian(session.parameters, session.postures)
    whole = with_arm(model, jacobian, session.arm.sigmas**-2.0, session.parameters)
    found, variances = [], replace(best.variances, trend_rotation=0.0, trend_translation=0.0)
    for row, (up_to, scale) in enumerate(wanted):
        columns = session.arm.indices(*(GROUPS[: GROUPS.index(up_to) + 1] if up_to else ()))
        absent = np.setdiff1d(np.arange(len(session.arm)), columns)
        restricted = fix_unknowns(whole, others + absent, -session.parameters[absent])
        known = restricted.prior_information.copy()
        known[others:] /= max(scale, 1e-9) ** 2
        restricted = replace(restricted, prior_information=known)
        variances = estimate_variances(restricted, levels[row] if levels else variances)
        found.append(_Restricted(up_to, scale, columns, restricted, variances))
    return found


def _linearised(views: TargetViews, chain: Chain, best: Estimate) -> MixedModel:
    model = linearise(exact_pixels(views.rows.seen, best.free), chain, best.camera, best.scale)
    centre_off = SystematicErrors(views.rows.systematic_errors.given_camera)
    return centre_off.apply(model, best.free, best.camera, chain.base_T_flange)


def _parameters_of(one: _Restricted, b: Array, k: int) -> Array:
    """All parameters (k,) after a step b (p,)."""
    others, parameters = one.model.unknowns - len(one.columns), np.zeros(k)
    parameters[one.columns] = b[others:] + one.model.prior_offset[others:]
    return parameters


def _embed(candidate: _Candidate, k: int) -> tuple[Array, Array]:
    """The other unknowns' step and all parameters (o + k,), and their covariance."""
    one, marginal = candidate.of, candidate.marginal
    others = one.model.unknowns - len(one.columns)
    mean = np.concatenate([marginal.b[:others], _parameters_of(one, marginal.b, k)])
    places = np.concatenate([np.arange(others), others + one.columns])
    covariance = np.zeros((others + k, others + k))
    covariance[np.ix_(places, places)] = marginal.covariance
    return mean, covariance


def _average(candidates: list[_Candidate], weights: Array, k: int) -> tuple[Array, Array]:
    """Mean (o + k,) of the other unknowns' step and the parameters, and their covariance, over the models."""
    means, covariances = (np.array(parts) for parts in zip(*(_embed(one, k) for one in candidates), strict=True))
    mean = weights @ means
    off = means - mean
    return mean, np.tensordot(weights, covariances, 1) + (weights[:, None] * off).T @ off


def _move(session: _Session, parameters: Array) -> _Session:
    """The session about the arm with these errors; each view keeps its own pose."""
    built, chains, first = session.arm.forward(parameters, session.postures), [], 0
    for chain in session.chains:
        poses = built[first : first + len(chain.base_T_flange)]
        first += len(poses)
        chains.append(replace(chain, base_T_flange=poses).with_corrections_from(chain.camera_T_target()))
    return replace(session, chains=chains, parameters=parameters)


def _conclude(session: _Session, candidates: list[_Candidate], models: int) -> ArmFit:
    """The fit from the model without errors and the likely ones of `models` with errors."""
    k, (without, *likely) = len(session.arm), candidates
    gains = np.array([one.marginal.log_evidence - without.marginal.log_evidence for one in likely])
    weights = np.exp(gains - gains.max())
    gain = float(gains.max() + np.log(weights.sum() / models))
    weights /= weights.sum()
    ladder = _ladder_rows(session, candidates, gains, weights)
    best = max(ladder[1:], key=lambda row: row.log_evidence)
    taken_up = gain > MIN_LOG_EVIDENCE and best.hold_out_mm <= MAX_HOLD_OUT_RATIO * ladder[0].hold_out_mm
    chosen, shares = (likely, weights) if taken_up else ([without], np.ones(1))
    mean, covariance = _average(chosen, shares, k)
    others = len(mean) - k
    targets = np.array([chain.anchor_T_target for chain in session.chains])
    kept, with_places = np.r_[0:6, others : others + k], np.r_[0 : 6 + 6 * len(targets), others : others + k]
    camera_T_target = np.concatenate([chain.camera_T_target() for chain in session.chains])
    return ArmFit(
        model=session.arm,
        taken_up=taken_up,
        views=len(session.postures),
        log_evidence=gain,
        parameters=mean[others:],
        covariance=covariance[np.ix_(kept, kept)],
        covariance_with_places=covariance[np.ix_(with_places, with_places)],
        mount_T_camera=session.chains[0].mount_T_camera @ transform_from_vector(mean[:6]),
        anchor_T_target=targets @ transform_from_vector(mean[6 : 6 + 6 * len(targets)].reshape(-1, 6)),
        variances=chosen[int(np.argmax(shares))].marginal.variances,
        seen=ArmViews(session.views[0].rows.setup, session.postures, camera_T_target, session.best.camera),
        ladder=ladder,
    )


def _ladder_rows(
    session: _Session, candidates: list[_Candidate], gains: Array, weights: Array
) -> tuple[LadderRow, ...]:
    """The model without errors, and the likeliest up to each group that is likely at all."""
    rows = [LadderRow(None, 0.0, 0.0, _hold_out_mm(session, candidates[0]), 0.0)]
    for group in GROUPS:
        own = [row for row, one in enumerate(candidates[1:]) if one.of.up_to == group]
        if own:
            likeliest = max(own, key=lambda row: float(gains[row]))
            one = candidates[1 + likeliest]
            share, gain = float(weights[own].sum()), float(gains[likeliest])
            rows.append(LadderRow(group, share, gain, _hold_out_mm(session, one), one.of.scale))
    return tuple(rows)


def _hold_out_mm(session: _Session, candidate: _Candidate) -> float:
    """RMS prediction error of the target's middle, at views left out by region of joint space."""
    model, n = candidate.of.model, len(session.postures)
    groups = _regions(session)
    middle = session.views[0].rows.nominal_mm.mean(axis=0, keepdims=True)
    centre = np.concatenate([map_points(_flange_T_target(chain), middle)[:, 0] for chain in session.chains])
    rows = point_rows(centre)
    whole = inverse_or_pseudo_inverse(model.UU)
    squares = 0.0
    for group in groups:
        kept = np.ones(n, bool)
        kept[group] = False
        step = solve(take_views(model, kept), candidate.marginal.variances)
        wanted = -(whole[group] @ (model.UAy[group] @ np.append(step.b, 1.0))[..., None])
        squares += float(np.sum((rows[group] @ wanted) ** 2))
    return float(np.sqrt(squares / n))


def _regions(session: _Session) -> list[NDArray[np.intp]]:
    """Groups of neighbours in joint space, with views of every place in each: the place itself must stay known."""
    q = session.postures.joints_rad
    turns = np.concatenate([np.sin(q), np.cos(q)], axis=1)
    regions: list[list[NDArray[np.intp]]] = [[] for _ in range(REGIONS)]
    for place in range(len(session.views)):
        own = np.flatnonzero(session.places == place)
        for region, rows in zip(
            regions, split(turns[own], max(2, min(REGIONS, len(own) // MIN_REGION_VIEWS))), strict=False
        ):
            region.append(own[rows])
    return [np.concatenate(region) for region in regions if region]


def _flange_T_target(chain: Chain) -> Array:
    """The target (n, 4, 4) in the frame of the flange, as each view saw it."""
    if chain.setup == "eye-in-hand":
        return chain.mount_T_camera @ chain.camera_T_target()
    return inverse(chain.corrected_base_T_flange()) @ chain.mount_T_camera @ chain.camera_T_target()
