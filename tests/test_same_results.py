"""The digests by which a change of the solver is held to its answers."""

from dataclasses import replace

import pytest

from calibration.solve import solve_hand_eye
from tests.same_results import KINDS, digest, problem_of
from tests.simulated.described_wrongly import FAULTS


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_sessions_of_its_own(kind: str) -> None:
    first, second = (problem_of(kind, number) for number in range(2))
    assert len(first.views) >= 3
    assert first.views[0].base_T_flange.tolist() != second.views[0].base_T_flange.tolist()


def test_the_digest_is_the_same_for_the_same_answer_and_another_for_another() -> None:
    solution = solve_hand_eye(problem_of(next(iter(FAULTS)), 0))
    again = solve_hand_eye(problem_of(next(iter(FAULTS)), 0))
    assert solution.mount_T_camera is not None
    assert digest(solution) == digest(again)
    assert digest(solution) != digest(replace(solution, mount_T_camera=solution.mount_T_camera + 1e-5))
    assert digest(solution) != digest(replace(solution, findings=solution.findings[1:]))
