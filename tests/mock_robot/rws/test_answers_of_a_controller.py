"""The mock's answers beside those of a real OmniCore (RobotWare 7.20): fields, types, links and titles.

What differs stands in docs/rws.md, with its reason, and nowhere else.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from drivers.robots.abb.rws.dialect import json_of
from mock_robot.rws.memory import RwsSignal
from protocols.cfg_file import CfgInstance
from tests.conftest import ROOT
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

pytestmark = pytest.mark.data
SAME_PLACE = {
    "cartesian": "/rw/motionsystem/mechunits/ROB_1/cartesian",
    "ctrl-state": "/rw/panel/ctrl-state",
    "dipc": "/rw/dipc",
    "elog": "/rw/elog/0?lang=en",
    "iodevices": "/rw/iosystem/devices",
    "ionetworks": "/rw/iosystem/networks",
    "iosignals": "/rw/iosystem/signals",
    "jointtarget": "/rw/motionsystem/mechunits/ROB_1/jointtarget",
    "mechunit-rob1": "/rw/motionsystem/mechunits/ROB_1",
    "mechunits": "/rw/motionsystem/mechunits",
    "opmode": "/rw/panel/opmode",
    "rapid-execution": "/rw/rapid/execution",
    "rapid-pcp": "/rw/rapid/tasks/T_ROB1/pcp",
    "robtarget": "/rw/motionsystem/mechunits/ROB_1/robtarget",
    "speedratio": "/rw/panel/speedratio",
    "vision": "/rw/vision",
    "ctrl-index": "/ctrl",
}
"""Path of a file of misc/; of others it is made from the name."""


@pytest.fixture
def answers(real_data: Path) -> Path:
    folder = real_data / "omnicore_7_20"
    if not folder.is_dir():
        pytest.skip(f"the answers of a real OmniCore are not at {folder}")
    return folder


@pytest.fixture(scope="module")
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart() as running:
        for at in range(101):
            running.world.memory.signals[f"signal_{at}"] = RwsSignal("DO", "Network/Device", False)
        for at in range(51):
            running.world.cabinet.record(0.0, 80001, f"handeyed\nentry {at}")
        yield running


def path_of(name: str) -> str:
    kind, _, rest = name.partition("-")
    return SAME_PLACE.get(name) or (f"/ctrl/{rest}" if kind == "ctrl" else f"/rw/{name}")


def shape(value: Any, place: str = "") -> Iterator[str]:
    """`place: type` of each leaf; items of a list by their class, of which `-li` says that it is listed."""
    if isinstance(value, dict):
        for name, each in value.items():
            yield from shape(each, f"{place}.{name}" if place else name)
    elif isinstance(value, list):
        for each in value:
            yield from shape(each, f"{place}[{each.get('_type', '')}]" if isinstance(each, dict) else place)
    else:
        yield f"{place}: {type(value).__name__}"


def differences() -> dict[str, set[str]]:
    """The table of docs/rws.md: resource to what differs."""
    text = (ROOT / "docs" / "rws.md").read_text("utf-8").partition("## Answers beside a real controller's")[2]
    text = text.partition("\n### ")[0]
    found = dict[str, set[str]]()
    for paths, what in re.findall(r"^\| (`.+?`) \| (.+?) \| .+ \|$", text, re.MULTILINE):
        found |= dict.fromkeys(re.findall(r"`([^`]+)`", paths), set(re.findall(r"`([^`]+)`", what)) or {what})
    return found


def what_differs(real: Any, ours: Any) -> set[str]:
    """Places of the leaves that only one has; the links to resources below one are a difference of their own."""
    below = "_embedded.resources[" if "state" in real else "nothing"
    wrong = set(shape(real)) ^ set(shape(ours))
    return {"links below" if each.startswith(below) else each.partition(":")[0] for each in wrong}


@pytest.fixture
def asked(cell: RwsCell) -> Iterator[Callable[[str], Any]]:
    """A document of the mock; None when it has none."""
    with cell.client_2() as client:

        def ask(path: str) -> Any:
            answer = client.get(path)
            return None if answer.status_code == httpx.codes.NOT_FOUND else json_of(answer.content)

        yield ask


def test_each_answer_has_the_structure_of_the_controllers(answers: Path, asked: Callable[[str], Any]) -> None:
    found = {}
    for file in sorted((answers / "misc").glob("*.json")):
        real, ours = json_of(file.read_bytes()), asked(path_of(file.stem))
        found[path_of(file.stem)] = {"not there"} if ours is None else what_differs(real, ours)
    assert {path: what for path, what in found.items() if what} == differences()


def test_tasks_and_modules_are_listed_as_the_controllers(answers: Path, asked: Callable[[str], Any]) -> None:
    for file, path in (("_tasks", "/rw/rapid/tasks"), ("T_ROB1/_modules", "/rw/rapid/tasks/T_ROB1/modules")):
        real, ours = json_of((answers / "rapid" / f"{file}.json").read_bytes()), asked(path)
        assert set(shape(real)) == set(shape(ours))
    titles = {each["_title"] for each in ours["state"]}
    assert "T_ROB1/BASE" in titles


def test_every_type_of_the_configuration_is_listed_as_the_controllers(
    answers: Path, cell: RwsCell, asked: Callable[[str], Any]
) -> None:
    before = cell.world.equipment.configuration
    checked = 0
    for file in sorted((answers / "cfg").glob("*/[A-Z]*.json")):
        domain, kind = file.parts[-2], file.stem
        real = json_of(file.read_bytes())
        attributes = [
            {each["_title"]: each["value"] for each in one["attrib"]} for one in real["_embedded"]["resources"]
        ]
        more = [attributes[-1]] * 5 if "next" in real["_links"] else []
        instances = {str(at): CfgInstance(kind, each, at) for at, each in enumerate([*attributes, *more])}
        cell.world.equipment.configuration = {domain: {kind: instances}}
        ours = asked(f"/rw/cfg/{domain}/{kind}/instances")
        assert [titled(each) for each in ours["_embedded"]["resources"]] == [
            titled(each) for each in real["_embedded"]["resources"]
        ], file
        assert set(shape(ours)) == set(shape(real)), file
        checked += 1
    cell.world.equipment.configuration = before
    assert checked > 60


def titled(resource: dict[str, Any]) -> Any:
    """Title and attributes; in a file, of which the mock has them, one without a value is TRUE."""
    return resource["_title"], [(each["_title"], each["value"] or "true") for each in resource["attrib"]]
