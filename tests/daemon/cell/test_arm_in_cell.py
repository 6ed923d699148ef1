"""The arm's load and temperature as they are known now."""

from calibration.kinematics.arm_conditions import ArmConditions
from calibration.kinematics.load import Load
from daemon.cell.arm_in_cell import ArmInCell

LOAD = Load(12.0, (0.0, 0.0, 80.0))


def test_a_temperature_holds_for_as_long_as_the_settings_say() -> None:
    now_s = [100.0]
    now = ArmInCell(None, LOAD, 60.0, lambda: now_s[0])
    assert (now.conditions(), now.temperature_age_s) == (ArmConditions(LOAD), None)
    now.state_temperature(31.5)
    now_s[0] += 60.0
    assert (now.conditions(), now.temperature_age_s) == (ArmConditions(LOAD, 31.5), 60.0)
    now_s[0] += 1.0
    assert (now.conditions(), now.temperature_age_s) == (ArmConditions(LOAD), None)
    now.state_temperature(33.0)
    assert now.conditions().temperature_c == 33.0
