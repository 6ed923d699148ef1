"""Converts poses and joints between RAPID data (mm, degrees) and the arm's (matrices, rad)."""

from typing import Any

import numpy as np

from calibration.errors import GeometryError
from calibration.transforms import Array, inverse, quaternion_from_rotation, transform_from_quaternion
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.values import single


def matrix_of(pose: list[Any]) -> Array:
    """Matrix (4, 4) of [trans, rot]."""
    try:
        return transform_from_quaternion(pose[0], pose[1])
    except GeometryError as error:
        raise RapidError("ERR_ILLQUAT", str(error)) from None


def singles(values: Any) -> list[float]:
    """Round numbers as a num stores them."""
    return [single(float(value)) for value in values]


def flange_of(target: list[Any], tool: list[Any], wobj: list[Any] | None) -> Array:
    """world_T_flange for a robtarget of a tool: world_T_user_T_object_T_tool without the tool."""
    return world_T_object(wobj) @ matrix_of(target) @ inverse(matrix_of(tool[1]))


def target_at(world_T_flange: Array, tool: list[Any], wobj: list[Any] | None) -> list[Any]:
    """[trans, rot] of the tool in the work object, in single precision."""
    object_T_tool = inverse(world_T_object(wobj)) @ world_T_flange @ matrix_of(tool[1])
    return [singles(object_T_tool[:3, 3]), singles(quaternion_from_rotation(object_T_tool[:3, :3]))]


def world_T_object(wobj: list[Any] | None) -> Array:
    """User frame times object frame; wobj0, the world frame, by default."""
    if wobj is None:
        return np.eye(4)
    joined: Array = matrix_of(wobj[3]) @ matrix_of(wobj[4])
    return joined


def joints_rad(joints: list[Any]) -> Array:
    """Axes (6,) in rad of a jointtarget."""
    axes: Array = np.radians(joints[0])
    return axes


def robax(joints: Array) -> list[float]:
    """RAPID's robjoint of axes (6,) in rad."""
    return singles(np.degrees(joints))
