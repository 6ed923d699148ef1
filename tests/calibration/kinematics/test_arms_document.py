"""docs/arms.md lists each arm with its numbers, its state and its source."""

from pathlib import Path

import numpy as np
import pytest

from calibration.kinematics.abb_arms import ARMS, find_arm
from calibration.kinematics.arm_evidence import evidence_of

PAGE = (Path(__file__).parents[3] / "docs" / "arms.md").read_text(encoding="utf-8")
ROWS = {line.split("|")[1].strip(): line for line in PAGE.splitlines() if line.startswith(("| IRB", "| CRB"))}


def test_every_arm_has_its_row() -> None:
    assert ROWS.keys() == ARMS.keys()


@pytest.mark.parametrize("name", ARMS)
def test_a_row_has_the_numbers_of_the_arm(name: str) -> None:
    arm, evidence = ARMS[name], evidence_of(name)
    _, _, lengths, limits, state, source, _ = (cell.strip() for cell in ROWS[name].split("|"))
    shoulder = (arm.shoulder_forward_mm, arm.shoulder_height_mm)
    assert [float(each) for each in lengths.split()] == [
        *shoulder, arm.lower_arm_mm, arm.elbow_up_mm, arm.forearm_mm, arm.flange_mm,
        *([arm.wrist_offset_mm] if arm.wrist_offset_mm else []),
    ]  # fmt: skip
    pairs = np.degrees([arm.lower_rad, arm.upper_rad]).round(3).T.tolist()
    assert limits == ", ".join(f"± {high:g}" if low == -high else f"{low:g}/{high:g}" for low, high in pairs)
    assert (state, source) == (evidence.state, evidence.source)


def test_axis_5_of_the_irb_4600_is_that_of_a_real_one() -> None:
    arm = find_arm("IRB 4600-40/2.55")
    assert np.degrees([arm.lower_rad[4], arm.upper_rad[4]]).round(6).tolist() == [-125.0, 120.0]
