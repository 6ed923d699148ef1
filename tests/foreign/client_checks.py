"""What the tests with foreign clients share: a cell in a thread, and the poses it truly reports."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO

import numpy as np

from calibration.transforms import quaternion_from_rotation
from mock_robot.rws.reading import format_float
from tests.mock_robot.rws_cell import RwsCell
from tests.support.waiting import eventually_blocking


@contextmanager
def quietly() -> Iterator[StringIO]:
    """Some clients print; what they said."""
    said = StringIO()
    with redirect_stdout(said):
        yield said


def held_by(cell: RwsCell) -> dict[str, str]:
    """The pose the cell's arm stands at, printed as a controller does."""
    pose = cell.controller.arm.reported_base_T_flange(cell.controller.robot_s(cell.cell.clock()))
    values = [*pose[:3, 3], *quaternion_from_rotation(pose[:3, :3])]
    return dict(zip(("x", "y", "z", "q1", "q2", "q3", "q4"), map(format_float, values), strict=True))


def digits(values: object) -> list[str]:
    """Numbers that a client made of text, as the text has them."""
    return [f"{float(value):.9g}" for value in np.ravel(np.asarray(values, float))]


@contextmanager
def unverified_https() -> Iterator[None]:
    """urllib3 warns of certificates nobody vouches for, which every controller has."""
    from urllib3.exceptions import InsecureRequestWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InsecureRequestWarning)
        yield


def move(cell: RwsCell, joints: np.ndarray) -> None:
    """Drive the arm there, and wait until it stands."""
    arm, clock = cell.controller.arm, cell.cell.clock
    cell.does(lambda: arm.depart(joints, 500.0, False, cell.controller.robot_s(clock())))
    eventually_blocking(lambda: arm.is_settled_at(cell.controller.robot_s(clock())))
