"""Poses and joints between RAPID's data and the arm's: mm and degrees on one side, matrices and rad on the other."""

from typing import Any

import numpy as np

from calibration.errors import GeometryError
from calibration.transforms import Array, inverse, quaternion_from_rotation, transform_from_quaternion
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.values import single

UNUSED_LEAST = 8.9e9
"""An unused external axis is 9E9; single precision makes it a little less."""


def matrix_of(pose: list[Any]) -> Array:
    """The matrix (4, 4) of [trans, rot]."""
    try:
        return transform_from_quaternion(pose[0], pose[1])
    except GeometryError as error:
        raise RapidError("ERR_ORIENT_VALUE", str(error)) from None


def trans_and_rot(matrix: Array) -> list[Any]:
    """[trans, rot] of a matrix (4, 4), in single precision."""
    return [singles(matrix[:3, 3]), singles(quaternion_from_rotation(matrix[:3, :3]))]


def singles(values: Any) -> list[float]:
    """Numbers as a num holds them."""
    return [single(float(value)) for value in values]


def flange_of(target: list[Any], tool: list[Any], wobj: list[Any] | None) -> Array:
    """base_T_flange of a robtarget whose tool point is meant: world_T_user_T_object_T_tool, without the tool."""
    base_T_tool = base_T_object(wobj) @ matrix_of(target)
    return base_T_tool @ inverse(matrix_of(tool[1]))


def target_at(base_T_flange: Array, tool: list[Any], wobj: list[Any] | None) -> list[Any]:
    """[trans, rot] of the tool in the work object."""
    return trans_and_rot(inverse(base_T_object(wobj)) @ base_T_flange @ matrix_of(tool[1]))


def base_T_object(wobj: list[Any] | None) -> Array:
    """User frame, then object frame; wobj0 when none is given."""
    if wobj is None:
        return np.eye(4)
    joined: Array = matrix_of(wobj[3]) @ matrix_of(wobj[4])
    return joined


def joints_rad(joints: list[Any]) -> Array:
    """The axes (6,) of a jointtarget."""
    axes: Array = np.radians(joints[0])
    return axes


def robax(joints: Array) -> list[float]:
    """RAPID's robjoint of axes (6,) in rad."""
    return singles(np.degrees(joints))
