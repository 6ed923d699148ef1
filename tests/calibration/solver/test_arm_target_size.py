"""The size of the target while the arm's errors are identified: known as it is without them, and found as well."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.knowledge import ARM_SHARE, ArmSource, Knowledge, TargetKnowledge
from calibration.solve import estimate_session, identify_arm_session
from calibration.solver.arm_hypotheses import hypotheses, restrict
from calibration.solver.arm_session import ArmSession, TargetViews, begin_arm_session
from mock_robot.arm.built_arm import build_arm
from tests.simulated.arms import ArmCell, arm_cell, reachable_views, target_before
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
    return begin_arm_session(ArmErrorModel(ARM), views, Postures(joints))


@pytest.mark.parametrize("arm", ["as-delivered", "absolute-accuracy"])
@pytest.mark.parametrize("target", [TargetKnowledge(), RULER, CERTIFIED], ids=["printed", "ruler", "certified"])
def test_the_prior_of_size_and_arm_is_that_of_the_estimate_without_errors(
    target: TargetKnowledge, arm: ArmSource
) -> None:
    session = session_of(standard_cell(0, 8, 2), Knowledge(target, arm=arm))
    wanted = hypotheses(session)
    assert session.best.nuisances is not None
    known = session.best.nuisances.prior
    assert sum(np.exp(one.log_prior) for one in wanted[1:]) == pytest.approx(1.0)
    for one in restrict(session, [wanted[0], wanted[-1]]):
        assert one.model.mixture is known
        assert one.model.mixture_at + known.size == session.size_place()
    variances = sorted(size**2 + share**2 for _, size in target.size_prior() for _, share in ARM_SHARE[arm])
    np.testing.assert_allclose(np.unique(1 / known.information[:, known.size]), variances)


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
