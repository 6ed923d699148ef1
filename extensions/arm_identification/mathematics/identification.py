"""The arm's errors identified with X and the target's places, by the restricted likelihood of the session.

Each model has the groups of errors up to one of them, and their standard deviations times one scale: a calibrated arm's
are a tenth of a new arm's. Estimates and covariance are averaged over the models by their evidence, so that what views
cannot decide stays uncertain. The errors are taken up where the evidence of all models together is above that of no
error by MIN_LOG_EVIDENCE, views left out by region of joint space are predicted no worse, and there are enough views.
Source of the evidence: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.errors import CalibrationError, GeometryError
from calibration.kinematics.abb_arms import ARMS
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import AXES, ArmErrorModel, Postures
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.kinematics.load import NO_LOAD, SAME_SHARE, Load
from calibration.likelihood.leave_out import split
from calibration.likelihood.mapped_points import point_rows
from calibration.likelihood.mixed_model import MixedModel, Variances, per_view_equations, solve
from calibration.likelihood.noise_marginalisation import Marginal, marginalise
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import covariance_of, inverse_or_pseudo_inverse, squared_distances
from calibration.problem import Problem, Setup
from calibration.sentences.sentence import from_one
from calibration.solution import ArmLadderDocument
from calibration.solve import estimate_session
from calibration.solver.view_outliers import MAX_ROUNDS, min_remaining, outlier_limit
from calibration.transforms import Array, map_points, transform_from_vector
from extensions.arm_identification.mathematics.hypotheses import (
    LADDER,
    Contradiction,
    Restricted,
    SessionsContradict,
    find_contradiction,
    hypotheses,
    restrict,
)
from extensions.arm_identification.mathematics.joints import approach_sides, require_joints_of_each_view
from extensions.arm_identification.mathematics.linear_models import take_views
from extensions.arm_identification.mathematics.session import (
    ArmSession,
    CheckedDistance,
    KnownDistance,
    TargetViews,
    begin_arm_session,
)

MIN_LOG_EVIDENCE = 5.0
"""Exceeded by chance in less than one of 140 perfect arms (Markov's inequality)."""

MIN_TAKEN_UP_VIEWS = 10
"""From 6 ordinary views errors were taken up for 7 of 12 arms of other forms, with errors 1.9 times as claimed."""

MAX_HOLD_OUT_SIGMAS = 1.0
"""By how many of its standard deviations the sum over the regions of what is predicted worse may be above zero."""

REGIONS, MIN_REGION_VIEWS = 6, 3
"""Groups of neighbours in joint space that are left out in turn."""

CLEAR_SIGMAS = 2.0
"""Of its own uncertainty: a worn arm may have, by its pictures, a little more play than the largest."""

MAX_LOG_DEFICIT = 8.0
"""Models whose log-likelihood is this far below the best are not averaged."""


@dataclass(frozen=True, eq=False)
class ArmViews:
    """The views that agree, one place after the other: postures, camera_T_target (n, 4, 4), and the camera."""

    setup: Setup
    postures: Postures
    camera_T_target: Array
    camera: CameraModel
    intrinsics_free: bool


@dataclass(frozen=True, eq=False)
class ArmFit(ArmEstimate):
    """What sessions say about the arm.

    taken_up : whether its errors enter X and poses.
    log_evidence : of errors of the arm against none, over all models.
    anchor_T_target : (m, 4, 4) of the target's places.
    covariance_with_all : of [X, the places of the target (6 m), the parameters (k), lens and target].
    target_scale : of the target against the description.
    seen : the views that agree.
    distances : the known ones, in their order, beside those found.
    contradiction : what in the sessions does not belong together; errors of an arm must not be taken from them then.
    """

    taken_up: bool
    log_evidence: float
    anchor_T_target: Array
    covariance_with_all: Array
    variances: Variances
    target_scale: float
    seen: ArmViews
    ladder: tuple[ArmLadderDocument, ...]
    distances: tuple[CheckedDistance, ...] = ()
    contradiction: Contradiction | None = None

    def beyond_usual(self) -> list[str]:
        """Names of parameters that are clearly beyond the largest that arms have, the farthest first."""
        sigmas = np.sqrt(np.diagonal(self.covariance)[6:])
        least = np.abs(self.parameters - self.model.means) - CLEAR_SIGMAS * sigmas
        sizes = least / [one.largest for one in self.model.parameters]
        return [self.model.parameters[row].name for row in np.argsort(-sizes) if sizes[row] > 1.0]


class UnusualArm(CalibrationError):
    """The views ask for errors that no arm has: `parameters` by name, the largest first."""

    def __init__(self, arm: str, parameters: list[str]) -> None:
        self.arm, self.parameters = arm, parameters
        super().__init__(
            f"the pictures ask for errors that no {arm} has ({', '.join(parameters[:3])}): check that the target stood"
            " still, its size, the zeros of the axes (revolution counters, a new motor), and their gears for play and"
            " wear"
        )


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A model with its marginal over the noise levels."""

    of: Restricted
    marginal: Marginal

    @property
    def log_evidence(self) -> float:
        """With the prior of its hypothesis."""
        return self.marginal.log_evidence + self.of.of.log_prior


def identify_arm_session(arm: Arm, problems: Sequence[Problem], distances: Sequence[KnownDistance] = ()) -> ArmFit:
    """The arm's errors, X and their covariance from sessions of images: of one target, at a place for each session.

    `distances`: known ones between the target's places, which are counted as the problems are. All views hold joints.
    Raises UndeterminedError where a session does not determine X without errors of the arm, GeometryError for views
    without joints, of different loads or of one beyond the arm's payload, JointsDisagree for joints that are not this
    arm's, SessionsContradict for views that do not belong together, UnusualArm for errors that arms do not have.
    """
    load, found = _load_of(arm, problems), []
    for problem in problems:
        alone = estimate_session(_with_own_joints(arm, problem), with_effects=False)
        seen, at = TargetViews(alone.prepared, alone.selection.used, alone.best), alone.prepared.seen.positions
        stood = np.array([view.stance.joints_rad for view in problem.views])
        celsius = np.array([view.arm_temperature_c for view in problem.views], float)  # NaN where it is not known
        found.append((seen, (stood[at], approach_sides(stood)[at], celsius[at])))  # it went from view to view
    order = sorted(range(len(found)), key=lambda row: -int(np.count_nonzero(found[row][0].used)))
    views, standstills = zip(*(found[row] for row in order), strict=True)
    known = [replace(one, first=order.index(one.first), second=order.index(one.second)) for one in distances]
    joints, sides, temperatures_c = (np.concatenate(parts) for parts in zip(*standstills, strict=True))
    mean_c = round(float(temperatures_c.mean()), 2)  # a step of 0.01 K moves no point by a micrometre
    warmth_k = None if np.isnan(mean_c) else temperatures_c - mean_c
    postures = Postures(joints, load or NO_LOAD, sides, warmth_k)
    fit = _identify(begin_arm_session(ArmErrorModel(arm), views, postures, known))
    if one := fit.contradiction:
        place = order[one.place]
        number = None if one.position is None else problems[place].views[one.position].index + 1
        raise SessionsContradict(one, place + 1, number)
    if unusual := fit.beyond_usual():
        raise UnusualArm(arm.name, unusual)
    return fit if warmth_k is None else replace(fit, temperature_c=mean_c)


def _load_of(arm: Arm, problems: Sequence[Problem]) -> Load | None:
    """What the flange carried in all of them, None where any of them does not state it. Raises GeometryError."""
    loads = [problem.load for problem in problems]
    known = [load for load in loads if load is not None]
    heaviest_kg = max((load.mass_kg for load in known), default=0.0)
    named = None if arm.row else re.search(r"-([\d.]+)/", arm.name)  # what a listed arm carries, in kg
    if named is not None and heaviest_kg > (1 + SAME_SHARE) * float(named[1]):
        raise GeometryError(
            f"the sessions carried {heaviest_kg:g} kg, an {arm.name} carries {float(named[1]):g} kg: correct the load"
        )
    for other in known[1:]:
        if not other.is_as(known[0]):
            raise GeometryError(
                f"the sessions carried {known[0].mass_kg:g} and {other.mass_kg:g} kg, or another centre: the errors of"
                " an arm are identified with one load"
            )
    return known[0] if known and len(known) == len(loads) else None


def _with_own_joints(arm: Arm, problem: Problem) -> Problem:
    """The problem, whose views hold joints of that arm. Raises GeometryError, JointsDisagree."""
    joints = [view.stance.joints_rad for view in problem.views]
    without = [view.index for view, one in zip(problem.views, joints, strict=True) if one is None or len(one) != AXES]
    if without:
        what = f"pictures {from_one(without)} hold no joints of six axes, from which an arm's errors are identified"
        raise GeometryError(f"{what}: record joints_deg, or confdata, since a pose has several postures")
    poses, numbers = np.array([view.base_T_flange for view in problem.views]), [view.index for view in problem.views]
    require_joints_of_each_view(arm, np.array(joints), poses, ARMS, numbers)
    return problem


def _identify(begun: ArmSession) -> ArmFit:
    """The arm's errors from views of the target at one place or several, which need not be known."""
    session, levels = _select(begun)
    wanted = hypotheses(session)
    restricted = restrict(session, wanted, levels)
    logs = np.array([one.log_likelihood() for one in restricted])
    with_errors = np.array([one.up_to is not None for one in wanted])
    contradiction = find_contradiction(session, restricted[int(np.argmax(np.where(with_errors, logs, -np.inf)))])
    likely = np.flatnonzero(with_errors & (logs > logs[with_errors].max() - MAX_LOG_DEFICIT))
    first = [one.unknowns(solve(one.model, one.variances).b, session) for one in (restricted[row] for row in likely)]
    session = session.move(np.mean(first, axis=0)[session.poses :])
    kept = [*np.flatnonzero(~with_errors), *likely]
    again = restrict(session, [wanted[row] for row in kept], [restricted[row].variances for row in kept])
    found = [_Candidate(one, marginalise(one.model, one.variances)) for one in again]
    return replace(_conclude(session, found), contradiction=contradiction)


def _select(session: ArmSession) -> tuple[ArmSession, list[Variances]]:
    """Only the views that the likeliest model explains, beginning with those used without errors of the arm.

    And the noise levels of each hypothesis with these.

    A model with errors is taken no narrower than an arm as delivered: the views used without errors are those that show
    little of them, and by themselves make the arm a calibrated one, which the others then contradict.
    """
    wanted = hypotheses(session)
    restricted = restrict(session.take(session.used), wanted)
    likeliest = int(np.argmax([one.log_likelihood() for one in restricted]))
    best, levels = wanted[likeliest], restricted[likeliest].variances
    if best.up_to is not None:
        best = replace(best, scale=max(best.scale, 1.0))
    (whole,) = restrict(session, [best], [levels])
    chosen = session.take(select_views_with_arm(whole.model, levels, session.used))
    return chosen, [one.variances for one in restricted]


def _average(session: ArmSession, candidates: Sequence[_Candidate]) -> tuple[Array, Array]:
    """Mean (6 + 6m + k,) of the step of X and the places and of the errors, and its covariance by evidence.

    The covariance is of lens and target as well, of which the mean is not asked.
    """
    whole = _log_sum(candidates)
    weights = np.array([np.exp(one.log_evidence - whole) for one in candidates])
    means = np.array([one.of.unknowns(one.marginal.b, session) for one in candidates])
    covariances = np.array([one.of.covariance(one.marginal.covariance, session) for one in candidates])
    mean = weights @ means
    off = np.pad(means - mean, [(0, 0), (0, covariances.shape[1] - len(mean))])
    return mean, np.tensordot(weights, covariances, 1) + (weights[:, None] * off).T @ off


def _log_sum(candidates: Sequence[_Candidate]) -> float:
    """Logarithm of the sum of the evidences."""
    return float(np.logaddexp.reduce([one.log_evidence for one in candidates]))


def _conclude(session: ArmSession, candidates: list[_Candidate]) -> ArmFit:
    """The fit from the models without errors and the likely ones with errors."""
    k, poses = len(session.arm), session.poses
    without, likely = ([one for one in candidates if (one.of.of.up_to is None) is drawn] for drawn in (True, False))
    gain = _log_sum(likely) - _log_sum(without)
    ladder, worse = _ladder_rows(session, without, likely)
    taken_up = gain > MIN_LOG_EVIDENCE and not worse and len(session.postures) >= MIN_TAKEN_UP_VIEWS
    chosen = likely if taken_up else without
    likeliest = max(chosen, key=lambda one: one.log_evidence)
    mean, covariance = _average(session, chosen)
    if not taken_up:
        covariance = _about_drawing(mean, covariance, *_average(session, likely), gain)
    kept = np.r_[0:6, poses : poses + k]
    targets = np.array([chain.anchor_T_target for chain in session.chains])
    targets = targets @ transform_from_vector(mean[6:poses].reshape(-1, 6))
    camera_T_target = np.concatenate([chain.camera_T_target() for chain in session.chains])
    first = session.views[0].rows
    scale = session.best.scale * float(np.exp(likeliest.marginal.b[session.size_place()]))
    return ArmFit(
        model=session.arm, taken_up=taken_up, log_evidence=gain, load=session.postures.load, ladder=ladder,
        parameters=mean[poses:], covariance=covariance[np.ix_(kept, kept)], covariance_with_all=covariance,
        mount_T_camera=session.chains[0].mount_T_camera @ transform_from_vector(mean[:6]), anchor_T_target=targets,
        variances=likeliest.marginal.variances, target_scale=scale,
        seen=ArmViews(first.setup, session.postures, camera_T_target, session.best.camera, first.nuisances.estimated),
        distances=session.check_distances(targets, scale, covariance[6:poses, 6:poses]),
    )  # fmt: skip


def _about_drawing(drawn: Array, of_drawn: Array, built: Array, of_built: Array, gain: float) -> Array:
    """Covariance of the truth about the estimate without errors, which may be there though they are not taken up."""
    share = 1 / (1 + np.exp(np.clip(MIN_LOG_EVIDENCE - gain, -500.0, 500.0)))
    off = np.pad(built - drawn, (0, len(of_drawn) - len(drawn)))
    return np.asarray((1 - share) * of_drawn + share * (of_built + np.outer(off, off)))


def _ladder_rows(
    session: ArmSession, without: Sequence[_Candidate], likely: Sequence[_Candidate]
) -> tuple[tuple[ArmLadderDocument, ...], bool]:
    """The likeliest model without errors, and the likeliest up to each group that is likely at all.

    And whether the likeliest of them predicts the views left out worse than that without.
    """
    none, best_of_all = (max(some, key=lambda one: one.log_evidence) for some in (without, likely))
    regions = _regions(session)
    squares = {id(none): _hold_out(session, none, regions)}
    rows = [ArmLadderDocument(None, 0.0, 0.0, _rms_mm(squares[id(none)], session))]
    for group in LADDER:
        own = [one for one in likely if one.of.of.up_to == group]
        if own:
            best = max(own, key=lambda one: one.log_evidence)
            share = float(np.exp(_log_sum(own) - _log_sum(likely)))
            gain = best.marginal.log_evidence - none.marginal.log_evidence
            squares[id(best)] = _hold_out(session, best, regions)
            rows.append(ArmLadderDocument(group, share, gain, _rms_mm(squares[id(best)], session)))
    more = squares[id(best_of_all)] - squares[id(none)]
    return tuple(rows), bool(more.sum() > MAX_HOLD_OUT_SIGMAS * np.sqrt(np.sum(more**2)))


def _rms_mm(squares: Array, session: ArmSession) -> float:
    return float(np.sqrt(squares.sum() / len(session.postures)))


def _hold_out(session: ArmSession, candidate: _Candidate, regions: Sequence[NDArray[np.intp]]) -> Array:
    """Sums (g,) of squared prediction errors of the target's middle, mm², at the views of each region left out."""
    found, n = candidate.marginal, len(session.postures)
    model = replace(candidate.of.model, prior_information=found.prior_information)
    middle = session.views[0].rows.nominal_mm.mean(axis=0, keepdims=True)
    centre = np.concatenate([map_points(chain.flange_T_target(), middle)[:, 0] for chain in session.chains])
    rows = point_rows(centre)
    whole = inverse_or_pseudo_inverse(model.UU)
    squares = []
    for region in regions:
        kept = np.ones(n, bool)
        kept[region] = False
        step = solve(take_views(model, kept), found.variances)
        wanted = -(whole[region] @ (model.UAy[region] @ np.append(step.b, 1.0))[..., None])
        squares.append(float(np.sum((rows[region] @ wanted) ** 2)))
    return np.array(squares)


def _regions(session: ArmSession) -> list[NDArray[np.intp]]:
    """Groups of neighbours in joint space, with views of every place in each: the place itself must stay known."""
    q = session.postures.joints_rad
    turns = np.concatenate([np.sin(q), np.cos(q)], axis=1)
    regions: list[list[NDArray[np.intp]]] = [[] for _ in range(REGIONS)]
    for place in range(len(session.views)):
        own = np.flatnonzero(session.places == place)
        count = max(2, min(REGIONS, len(own) // MIN_REGION_VIEWS))
        for region, rows in zip(regions, split(turns[own], count), strict=False):
            region.append(own[rows])
    return [np.concatenate(region) for region in regions if region]


def select_views_with_arm(model: MixedModel, variances: Variances, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The views (n,) of `model` that agree, beginning with the `used` ones and their noise levels.

    Errors of the arm make views disagree, so that the choice made for the arm as drawn leaves out views that say most
    about them. Views that fit are readmitted and the one that fits worst is dropped, as in `view_outliers`, with the
    arm's errors among the unknowns.
    """
    seen_before: set[bytes] = set()
    for _ in range(MAX_ROUNDS):
        seen_before.add(used.tobytes())
        variances = estimate_variances(take_views(model, used), variances)
        changed = _update_views(model, variances, used)
        if changed.tobytes() in seen_before:
            break
        used = changed
    return used


def _update_views(model: MixedModel, variances: Variances, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    changed, distances = used.copy(), _measure_distances(model, variances, used) / 6
    limit = outlier_limit(int(np.count_nonzero(used)), len(used))
    back = ~used & (distances < limit)
    if np.any(back):
        return changed | back
    if np.count_nonzero(used) > min_remaining(len(used)):
        worst = int(np.argmax(np.where(used, distances, -np.inf)))
        changed[worst] = not distances[worst] > limit
    return changed


def _measure_distances(model: MixedModel, variances: Variances, used: NDArray[np.bool_]) -> Array:
    """Squared Mahalanobis distance (n,) of each view's own pose from its prediction by the other used views; 6 dof."""
    p = model.unknowns
    kept = take_views(model, used)
    step = solve(kept, variances)
    information, gradient = per_view_equations(kept, variances, step)
    b, covariance = np.tile(step.b, (len(used), 1)), np.tile(step.covariance, (len(used), 1, 1))
    covariance[used] = covariance_of(step.information - information)
    b[used] = -(covariance[used] @ (step.gradient - gradient)[..., None])[..., 0]
    own = covariance_of(model.UU)  # of the robot's correction by which a view's own pose is reproduced, per px²
    by_shared = own @ model.UAy[:, :, :p]
    off = (by_shared @ b[..., None])[..., 0] + (own @ model.UAy[:, :, p, None])[..., 0]
    spread = variances.pixel * own + np.diag(variances.deviations() ** 2)
    return squared_distances(off, spread + by_shared @ covariance @ np.swapaxes(by_shared, 1, 2))
