"""The size of the target while the arm's errors are identified: known as it is without them, and found as well."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.kinematics.robot_accuracy import PRIOR_NOISE
from calibration.knowledge import ARM_SHARE, ArmSource, Knowledge, TargetKnowledge
from calibration.likelihood.mixed_model import Variances, solve, with_arm
from calibration.solve import estimate_session
from extensions.arm_identification.mathematics.hypotheses import SCALES, hypotheses, restrict
from extensions.arm_identification.mathematics.identification import identify_arm_session
from extensions.arm_identification.mathematics.session import ArmSession, TargetViews, begin_arm_session
from mock_robot.arm.built_arm import build_arm
from tests.simulated.arms import REPEATABILITY, ArmCell, arm_cell, lengths_of, reachable_views, target_before
from tests.simulated.sessions import BOARD

ARM = find_arm("IRB 2600-20/1.65")
TARGETS = (target_before(ARM), target_before(ARM, 0.45, 0.1, 0.45), target_before(ARM, 0.5, 0.05, -0.4))
RULER = TargetKnowledge.measured(165.0, "ruler-class-2")
CERTIFIED = TargetKnowledge("certified", 0.0)


def standard_cell(seed: int, views: int, places: int) -> ArmCell:
    """As many views of each place of the target."""
    rng, targets = np.random.default_rng(seed), TARGETS[:places]
    joints = [reachable_views(rng, ARM, target, views) for target in targets]
    return arm_cell(rng, build_arm(ARM, "standard", seed), joints, targets)


def session_of(cell: ArmCell, knowledge: Knowledge) -> ArmSession:
    """The session before any error is identified."""
    estimates = [estimate_session(replace(problem, knowledge=knowledge)) for problem in cell.problems]
    views = [TargetViews(one.prepared, one.selection.used, one.best) for one in estimates]
    joints = np.array([view.stance.joints_rad for problem in cell.problems for view in problem.views])
    return begin_arm_session(ArmErrorModel(cell.built.drawing), views, Postures(joints))


@pytest.mark.parametrize("arm", ["as-delivered", "absolute-accuracy"])
@pytest.mark.parametrize("target", [TargetKnowledge(), RULER, CERTIFIED], ids=["printed", "ruler", "certified"])
def test_the_size_is_against_the_drawn_arm_without_errors_and_against_the_true_millimetre_with_them(
    target: TargetKnowledge, arm: ArmSource
) -> None:
    session = session_of(standard_cell(0, 8, 2), Knowledge(target, arm=arm))
    wanted = hypotheses(session)
    assert session.best.nuisances is not None
    known = session.best.nuisances.prior
    assert sum(np.exp(one.log_prior) for one in wanted[1:]) == pytest.approx(1.0)
    drawn, built = restrict(session, [wanted[0], wanted[-1]])
    assert drawn.model.mixture is known and built.model.mixture is not None
    assert built.model.mixture_at + known.size == session.size_place()
    sizes = {size**2 for _, size in target.size_prior()}
    with_share = {size + share**2 for size in sizes for _, share in ARM_SHARE[arm]}
    for prior, variances in ((known, with_share), (built.model.mixture, sizes)):
        found = np.unique(np.round(1 / prior.information[:, known.size], 12))
        np.testing.assert_allclose(found, sorted(variances), atol=1e-11)


@pytest.mark.parametrize("name", ["IRB 1600-6/1.45", "IRB 2600-20/1.65", "IRB 6700-200/2.60"])
def test_what_is_not_known_of_a_drawn_arms_millimetre_is_what_errors_of_arms_do_to_it(name: str) -> None:
    """By how much errors of an arm, zeros and sag more than lengths, change the size of a target that is seen from one
    posture: were a scale of all links among the unknowns as well, the same would count twice."""
    arm, rng = find_arm(name), np.random.default_rng(0)
    joints = reachable_views(rng, arm, target_before(arm), 20, one_posture=True)
    cell = arm_cell(rng, build_arm(arm, "perfect", 0), [joints], [target_before(arm)])
    session = session_of(cell, Knowledge())
    model, k, size = session.linearise(), len(session.arm), session.size_place()
    rigid = np.where(np.arange(model.unknowns) > size, 1e12, model.prior_information)
    rigid[size] = 0.0
    jacobian = session.arm.jacobian(np.zeros(k), session.postures)
    whole = with_arm(replace(model, prior_information=rigid), jacobian, np.zeros(k), np.zeros(k))
    noise = PRIOR_NOISE.levels() ** 2
    information = solve(whole, Variances(REPEATABILITY.image_px**2, *noise)).information
    by_errors = -np.linalg.solve(information[:-k, :-k], information[:-k, -k:])[size]
    delivered = float(np.hypot(by_errors @ session.arm.means, np.linalg.norm(by_errors * session.arm.sigmas)))
    assumed, found = (
        np.sqrt(sum(probability * share**2 for share, probability in shares))
        for shares in ([(share, p) for p, share in ARM_SHARE["as-delivered"]], SCALES.items())
    )
    assert 0.7 < delivered * found / assumed < 1.2


def test_a_certified_target_tells_how_long_an_arm_is() -> None:
    """The mean of its lengths' shares; a print leaves it as open as it is among arms."""
    cell, lengths_mm = standard_cell(1, 9, 3), np.zeros(len(ArmErrorModel(ARM)))
    for name, length_mm in lengths_of(ARM).items():
        lengths_mm[ArmErrorModel(ARM).index(name)] = length_mm
    mean, sigmas = lengths_mm / np.sum(lengths_mm**2), []
    for target in (TargetKnowledge(), CERTIFIED):
        fit = identify_arm_session(ARM, [replace(problem, knowledge=Knowledge(target)) for problem in cell.problems])
        sigmas.append(float(np.sqrt(mean @ fit.covariance[6:, 6:] @ mean)))
        assert abs(mean @ (fit.parameters - cell.built.errors)) < 3 * sigmas[-1]
    assert sigmas[1] < 0.85 * sigmas[0]
    assert sigmas[0] == pytest.approx(np.linalg.norm(mean * ArmErrorModel(ARM).sigmas), rel=0.2)


@pytest.mark.parametrize("size", [0.995, 1.01])
def test_a_print_that_is_off_bends_neither_the_arm_nor_x(size: float) -> None:
    cell = standard_cell(1, 9, 3)
    described = replace(BOARD, pitch_mm=BOARD.pitch_mm / size)
    exact = identify_arm_session(ARM, cell.problems)
    off = identify_arm_session(ARM, [replace(problem, target=described) for problem in cell.problems])
    assert off.taken_up
    assert off.target_scale == pytest.approx(size, abs=1e-3)
    assert np.abs((off.parameters - exact.parameters) / off.model.sigmas).max() < 0.2
    moved = off.mount_T_camera[:3, 3] - cell.mount_T_camera[:3, 3]
    assert np.linalg.norm(moved) < 0.2
