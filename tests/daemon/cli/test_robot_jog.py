"""`handeyed robot jog` at the mock: an axis turns, all axes go to their angles, and what leaves the box is refused."""

from pathlib import Path

import numpy as np
import pytest

from tests.daemon.cli.running import Ran, handeyed
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

SETTINGS = """[robot]
address = "tcp://{host}:{port}"
model = "{arm}"
box_mm = [[-1600.0, -1600.0, 0.0], [1600.0, 1600.0, {top}]]
[camera]
address = "folder:."
[target]
kind = "chessboard"
columns = 7
rows = 9
pitch_mm = 20.0
"""


def jog(cell: RwsCell, folder: Path, *options: str, top: float = 2200.0) -> Ran:
    host, port = cell.robot
    file = folder / "handeyed.toml"
    file.write_text(SETTINGS.format(host=host, port=port, arm=cell.cell.truth.arm, top=top))
    return handeyed("robot", "jog", file, *options)


def joints_of(cell: RwsCell) -> np.ndarray:
    controller = cell.controller
    return controller.arm.joints_at(controller.robot_s(cell.cell.clock()))


def test_an_axis_turns_and_all_axes_go_to_their_angles(tmp_path: Path) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: setattr(cell.controller, "time_scale", 100.0))
        start = joints_of(cell)
        done = jog(cell, tmp_path, "--axis", "6", "--by", "-12", "--yes")
        assert done.status == 0, done.err
        np.testing.assert_allclose(np.degrees(joints_of(cell) - start), [0, 0, 0, 0, 0, -12], atol=1e-3)
        to = ",".join(f"{angle:.6f}" for angle in np.degrees(start))
        assert jog(cell, tmp_path, f"--to={to}", "--yes").status == 0
        np.testing.assert_allclose(joints_of(cell), start, atol=1e-5)
        assert not cell.controller.armed


@pytest.mark.parametrize(
    ("options", "top", "why"),
    [
        (("--by", "5"), 2200.0, "Aborted"),
        (("--to", "1,2,3", "--yes"), 2200.0, "six angles"),
        (("--to=400,0,0,0,0,0", "--yes"), 2200.0, "limit 270"),
        (("--to=0,0,0,0,170,0", "--yes"), 2200.0, "beyond its limit"),
        (("--by", "5", "--yes"), 100.0, "outside the box"),
    ],
)
def test_what_is_refused_moves_nothing(tmp_path: Path, options: tuple[str, ...], top: float, why: str) -> None:
    with rws_cell_apart() as cell:
        refused = jog(cell, tmp_path, *options, top=top)
        assert refused.status != 0
        assert why in refused.err
        assert cell.controller.moves_accepted == 0
