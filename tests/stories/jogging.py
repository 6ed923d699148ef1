"""An operator who jogs the arm of the mock cell by joystick."""

from typing import Any

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, rotation_from_vector, transform
from tests.mock_robot.running_cell import RunningCell
from tests.support.waiting import eventually

SMALL_PICTURES_MM = 0.4
AXES = {"x": [1.0, 0, 0], "y": [0, 1.0, 0], "z": [0, 0, 1.0]}


def jogs(cell: RunningCell, base_T_flange: Array) -> None:
    """The operator moves the joystick: the controller's own program has nothing to do with it."""
    arm, robot_s = cell.controller.arm, cell.controller.robot_s(cell.cell.clock())
    arm.depart(arm.arm.nearest(base_T_flange, arm.joints_at(robot_s)), 250.0, False, robot_s)


async def jogs_and_waits(cell: RunningCell, base_T_flange: Array) -> None:
    jogs(cell, base_T_flange)
    await eventually(lambda: settled(cell))


def settled(cell: RunningCell) -> bool:
    return cell.controller.arm.is_settled_at(cell.controller.robot_s(cell.cell.clock()))


def reported(cell: RunningCell) -> Array:
    return cell.controller.arm.reported_base_T_flange(cell.controller.robot_s(cell.cell.clock()))


def roughly(base_T_flange: Array, rng: np.random.Generator) -> Array:
    """As near as a person with a joystick gets to a pose."""
    return base_T_flange @ transform(
        rotation_from_vector(np.radians(2.0) * rng.standard_normal(3)), 5.0 * rng.standard_normal(3)
    )


def where_next(cell: RunningCell, planning: dict[str, Any], rng: np.random.Generator) -> Array:
    """What the operator makes of the advice: the pose, or only the turn where no pose is known."""
    if planning["next_pose"] is not None:
        return roughly(PoseDocument.model_validate(planning["next_pose"]).transform(), rng)
    axis = planning["advice"].split("about its ")[1][0]
    here = reported(cell)
    return here @ transform(rotation_from_vector(np.radians(12.0) * np.array(AXES[axis])), np.zeros(3))
