"""`handeyed robot write-frame` against the mock's Robot Web Services: shown, asked, written, read back."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from calibration.documents.calibration import CalibrationDocument
from calibration.transforms import Array, difference, transform_from_quaternion
from daemon.cli.main import app
from drivers.robots.abb.rws.rapid_data import components
from mock_robot.rws.memory import Symbol
from tests.daemon.calibrations import a_calibration
from tests.daemon.cli.running import handeyed
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

LOAD = "[7.5,[8,9,10.25],[1,0,0,0],0.011,0.012,0.013]"
TOOL = f"[TRUE,[[1,2,3],[1,0,0,0]],{LOAD}]"
WOBJ = '[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]'


def prepared(cell: RwsCell, tool: str = TOOL) -> None:
    cell.world.memory.symbols["T_ROB1/user/camera_tool"] = Symbol("tooldata", tool)
    cell.world.memory.symbols["T_ROB1/user/table"] = Symbol("wobjdata", WOBJ)
    run_program(cell, False)


def run_program(cell: RwsCell, running: bool) -> None:
    cell.does(lambda: cell.world.cabinet.run_program(running, cell.cell.clock()))


def calibration_file(folder: Path, *, accepted: bool = True) -> Path:
    file = folder / "calibration.json"
    file.write_text(a_calibration("cal-1", accepted=accepted).model_dump_json())
    return file


@pytest.mark.parametrize("version", [1, 2])
def test_the_frame_is_written_with_consent_and_nothing_else(tmp_path: Path, version: int) -> None:
    file = calibration_file(tmp_path)
    known = CalibrationDocument.model_validate_json(file.read_bytes())
    assert known.flange_T_camera is not None
    assert known.base_T_target is not None
    with rws_cell_apart() as cell:
        prepared(cell)
        command = ["robot", "write-frame", cell.rws(version), str(file), "--tooldata", "camera_tool"]
        refused = CliRunner().invoke(app, command, input="n\n")
        assert refused.exit_code == 1
        assert cell.world.memory.symbols["T_ROB1/user/camera_tool"].value == TOOL
        done = CliRunner().invoke(app, command, input="y\n")
        assert done.exit_code == 0, done.stderr
        assert "read back" in done.stdout
        robhold, frame, load = components(cell.world.memory.symbols["T_ROB1/user/camera_tool"].value)
        assert (robhold, load) == ("TRUE", LOAD)
        assert difference(pose_in(frame), known.flange_T_camera.transform())[0] < 1e-4

        wobj = handeyed("robot", "write-frame", cell.rws(version), file, "--wobjdata", "table", "--yes")
        assert wobj.status == 0, wobj.err
        *before, uframe, oframe = components(cell.world.memory.symbols["T_ROB1/user/table"].value)
        assert [*before, oframe] == components(WOBJ)[:3] + components(WOBJ)[4:]
        assert difference(pose_in(uframe), known.base_T_target.transform())[0] < 1e-4


def pose_in(frame: str) -> Array:
    position, turn = ([float(number) for number in part.strip("[] ").split(",")] for part in components(frame))
    return transform_from_quaternion(position, turn)


def test_what_must_not_be_written_is_refused(tmp_path: Path) -> None:
    file = calibration_file(tmp_path)
    with rws_cell_apart() as cell:
        prepared(cell)

        def refusal(*more: str) -> tuple[int, str]:
            ran = handeyed("robot", "write-frame", cell.rws(2), file, "--yes", *more)
            return ran.status, ran.err

        for arguments, status, words in (
            (("--tooldata", "table"), 1, "is a wobjdata"),
            (("--tooldata", "nowhere"), 1, ""),
            (("--tooldata", "tool0"), 2, "the controller's own"),
            (("--tooldata", "a/b"), 2, "no name of RAPID"),
            ((), 2, "give --tooldata or --wobjdata"),
            (("--tooldata", "camera_tool", "--wobjdata", "table"), 2, "one frame"),
        ):
            found, err = refusal(*arguments)
            assert (found, words in err) == (status, True), (arguments, err)
        cell.world.memory.symbols["T_ROB1/user/camera_tool"].value = TOOL.replace("TRUE", "FALSE", 1)
        assert "robhold" in refusal("--tooldata", "camera_tool")[1]
        prepared(cell)
        cell.does(lambda: cell.cell.inject_fault("rws-mastership-held"))
        assert refusal("--tooldata", "camera_tool")[0] == 1
        assert cell.world.memory.symbols["T_ROB1/user/camera_tool"].value == TOOL


def test_a_rejected_calibration_needs_a_word(tmp_path: Path) -> None:
    file = calibration_file(tmp_path, accepted=False)
    with rws_cell_apart() as cell:
        prepared(cell)
        command = ("robot", "write-frame", cell.rws(1), file, "--tooldata", "camera_tool", "--yes")
        assert handeyed(*command).status == 3
        assert handeyed(*command, "--despite-verdict").status == 0


def test_a_running_program_keeps_its_frames(tmp_path: Path) -> None:
    file = calibration_file(tmp_path)
    with rws_cell_apart() as cell:
        prepared(cell)
        run_program(cell, True)
        ran = handeyed("robot", "write-frame", cell.rws(2), file, "--tooldata", "camera_tool", "--yes")
        assert (ran.status, "the program runs" in ran.err) == (1, True)


def test_records_are_taken_apart() -> None:
    assert components('[FALSE,TRUE,"a,]b",[[1,2],[3]], 4 ]') == ["FALSE", "TRUE", '"a,]b"', "[[1,2],[3]]", "4"]
    assert components("no record") == []
