"""`handeyed robot upload` against the mock's Robot Web Services: asked first, written then, never half."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from daemon.cli.main import app
from daemon.cli.robot_setup import program_files, rws_address
from mock_robot.cabinet.panel import Mode
from tests.daemon.cli.running import handeyed
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

MODULES = Path(__file__).parents[3] / "deploy" / "rapid"


@pytest.mark.parametrize("version", [1, 2])
def test_the_shipped_modules_are_written_when_somebody_consents(version: int) -> None:
    with rws_cell_apart() as cell:
        refused = CliRunner().invoke(app, ["robot", "upload", cell.rws(version), str(MODULES)], input="n\n")
        assert refused.exit_code == 1
        assert "nothing was written" in refused.stderr
        assert written(cell) == {}
        done = CliRunner().invoke(app, ["robot", "upload", cell.rws(version), str(MODULES)], input="y\n")
        assert done.exit_code == 0, done.stderr
        assert "motoron, AUTO" in done.stdout
        fragments = MODULES / ("rw6" if version == 1 else "rw7")
        sent = [path for path in (*MODULES.glob("CELL_*"), *fragments.glob("*.cfg")) if path.name != "CELL_egm.mod"]
        assert written(cell) == {f"HOME/handeyed/{path.name}": path.read_bytes() for path in sent}


def test_only_what_is_wanted_is_copied() -> None:
    everything = program_files(MODULES, 6, called=False, egm="10.0.0.9")
    called = program_files(MODULES, 6, called=True, egm=None)
    assert everything.keys() - called.keys() == {"CELL_main.mod", "CELL_egm.mod", "SIO_egm.cfg"}
    assert b'"10.0.0.9"' in everything["SIO_egm.cfg"]
    assert called["SYS.cfg"] == (MODULES / "rw6" / "called" / "SYS.cfg").read_bytes() != everything["SYS.cfg"]


def test_files_are_written_while_the_pendant_has_the_controller() -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: cell.cell.inject_fault("rws-mastership-held"))
        cell.does(lambda: cell.controller.switch_mode(Mode.MANR, cell.cell.clock()))
        assert handeyed("robot", "upload", cell.rws(2), MODULES, "--yes").status == 0
        assert {Path(name).name for name in written(cell)} > {"CELL_shared.sys", "CELL_comm.mod", "EIO.cfg"}


def test_what_cannot_be_uploaded_is_reported_before_anybody_is_asked(tmp_path: Path) -> None:
    assert "no RAPID module is in it" in handeyed("robot", "upload", "rws://127.0.0.1", tmp_path).err
    assert handeyed("robot", "upload", "rws://127.0.0.1", tmp_path / "none").status == 2
    assert "write rws://host" in handeyed("robot", "upload", "tcp://127.0.0.1:4242", MODULES).err


@pytest.mark.parametrize("given", ["10.0.0.2", "http://10.0.0.2", "https://10.0.0.2", "rws://10.0.0.2"])
def test_a_controller_is_named_as_a_person_copies_it(given: str) -> None:
    assert rws_address(given).address == "rws://10.0.0.2"


def written(cell: RwsCell) -> dict[str, bytes]:
    return dict(cell.world.volumes.files)
