"""Displacements of a program: of its targets in the work object, and of external axes."""

from types import MappingProxyType
from typing import Any

import numpy as np

from calibration.transforms import Array, inverse
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.poses import c_rob_t
from mock_robot.rapid.postures import matrix_of, trans_and_rot
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask

UNUSED = 8.9e9
AXES = 6


def displace(
    task: ProgramTask,
    turned: bool | None,
    executed: list[Any] | None,
    programmed: list[Any],
    tool: Slot,
    wobj: Slot | None,
) -> None:
    """From the programmed point to `executed`, by default where the tool is; only with \\Rot its orientation, too."""
    task.services.unit.displacement = None
    here = c_rob_t(task, None, None, tool, wobj) if executed is None else executed
    there_T, here_T = matrix_of(programmed), matrix_of(here)
    if not turned:
        shift: Array = np.eye(4)
        shift[:3, 3] = here_T[:3, 3] - there_T[:3, 3]
    task.services.unit.displacement = here_T @ inverse(there_T) if turned else shift


def set_displacement(task: ProgramTask, frame: list[Any]) -> None:
    task.services.unit.displacement = matrix_of(frame)


def end_displacement(task: ProgramTask) -> None:
    task.services.unit.displacement = None


def offset_axes(task: ProgramTask, executed: list[Any] | None, programmed: list[Any]) -> None:
    """From the programmed external axes to `executed`, by default where they are."""
    here = task.services.unit.external_axes() if executed is None else executed[3]
    _offset(task, [a - b for a, b in zip(here, programmed[3], strict=True)])


def set_offsets(task: ProgramTask, offsets: list[float]) -> None:
    _offset(task, offsets)


def end_offsets(task: ProgramTask) -> None:
    _offset(task, [0.0] * AXES)


def _offset(task: ProgramTask, offsets: list[float]) -> None:
    task.services.unit.external_offsets = [0.0 if abs(each) >= UNUSED else each for each in offsets]


def frame_of_points(
    task: ProgramTask, first: list[Any], second: list[Any], third: list[Any], origin: float | None
) -> list[Any]:
    """x from the first point to the second, the third on the side of y; the origin is the first point or, with
    \\Origin 2 or 3, the second or the third's foot on x."""
    a, b, c = (np.array(each[0], float) for each in (first, second, third))
    x = b - a
    normal = np.cross(x, c - a)
    if not np.linalg.norm(normal) > 0.0:
        raise RapidError("ERR_FRAME", "the three points lie on a line")
    x, z = x / np.linalg.norm(x), normal / np.linalg.norm(normal)
    frame: Array = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    frame[:3, 3] = {1: a, 2: b, 3: a + x * float(x @ (c - a))}.get(int(origin or 1), a)
    return trans_and_rot(frame)


DOES = MappingProxyType(
    {
        "PDispOn": displace,
        "PDispSet": set_displacement,
        "PDispOff": end_displacement,
        "EOffsOn": offset_axes,
        "EOffsSet": set_offsets,
        "EOffsOff": end_offsets,
        "DefFrame": frame_of_points,
    }
)
