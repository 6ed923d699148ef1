"""The modules under other names: two sets load into one controller, and the shipped names change nothing."""

from pathlib import Path

import pytest

from drivers.robots.abb.rapid_names import RapidNames
from mock_robot.rapid.program import PersistentMemory, Program, Source
from mock_robot.rapid.signals import Signal
from mock_robot.rapid.tasks import ProgramTask
from tests.mock_robot.rapid.rules import offences
from tests.mock_robot.rapid.snippets import raise_failure

RAPID = Path(__file__).parents[3] / "deploy" / "rapid"
FILES = {path.name: path.read_bytes().decode("ascii") for path in sorted(RAPID.glob("CELL_*"))}
LEFT = RapidNames("T_ROB_L", "T_COMM_L", "ROB_L", 4242, "celll")
RIGHT = RapidNames("T_ROB_R", "T_COMM_R", "ROB_R", 4243, "cellr")


def test_the_shipped_names_are_those_of_the_shipped_files() -> None:
    assert RapidNames().rename_all(FILES) == FILES
    assert "cell_port := 4242;" in FILES["CELL_shared.sys"]
    assert 'cell_motion_task := "T_ROB1";' in FILES["CELL_shared.sys"]


@pytest.mark.parametrize("names", [LEFT, RIGHT])
def test_nothing_is_left_of_the_shipped_names_and_the_modules_keep_the_rules(names: RapidNames) -> None:
    for name, text in names.rename_all(FILES).items():
        assert name.startswith(names.prefix.upper())
        for shipped in ("T_ROB1", "T_HANDEYED\b", "ROB_1", " cell_", " CELL_", " CB_"):
            assert shipped not in text
        assert offences(text.encode("ascii")) == []
        assert "port := 4242" not in text or names.port == 4242


@pytest.mark.slow
def test_the_sets_of_two_arms_load_beside_each_other() -> None:
    """Shared modules are seen by every task: a name of one arm must not be a name of the other."""
    memory = PersistentMemory()
    left, right = LEFT.rename_all(FILES), RIGHT.rename_all(FILES)
    shared = [
        Source(name, text, shared=True)
        for arm in (left, right)
        for name, text in arm.items()
        if name.endswith("_shared.sys")
    ]
    for names, arm in ((LEFT, left), (RIGHT, right)):
        prefix = names.prefix
        signals = {f"{prefix}_do_{what}": Signal(what, "DO") for what in ("motors", "estop", "running", "error")}
        for task, modules in ((names.motion_task, ("motion", "main")), (names.link_task, ("comm",))):
            own = [Source(m, arm[f"{prefix.upper()}_{m}.mod"]) for m in modules]
            program = Program(ProgramTask(task, raise_failure, task == names.motion_task), memory, signals)
            program.load([*shared, *own])
            assert callable(program.main())
    assert memory["celll_port"].value == 4242
    assert memory["cellr_port"].value == 4243
    assert memory["cellr_motion_task"].value == "T_ROB_R"
