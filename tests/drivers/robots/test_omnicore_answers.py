"""What a real OmniCore (RobotWare 7.20) answered, read by the driver."""

import json
import re
from pathlib import Path

import pytest

from daemon.cli.robot_setup import program_files
from drivers.errors import RequestRefused
from drivers.robots.abb.rapid_names import RapidNames
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.administration import RwsAdministration
from drivers.robots.abb.rws.client import RwsClient
from drivers.robots.abb.rws.dialect import DIALECTS
from drivers.robots.abb.rws.parsing import log_entry
from drivers.robots.abb.setup.plan import Package, configuration_findings, plan_setup
from drivers.robots.abb.setup.requirements import findings
from drivers.robots.abb.setup.survey import read_survey
from mock_robot.rapid.configuration import attributes_of
from mock_robot.rapid.controller import DEPLOYED
from protocols.cfg_file import parse_cfg

pytestmark = pytest.mark.data


@pytest.fixture
def answers(real_data: Path) -> Path:
    folder = real_data / "omnicore_7_20"
    if not folder.is_dir():
        pytest.skip(f"the answers of a real OmniCore are not at {folder}")
    return folder


def test_every_answer_is_read(answers: Path) -> None:
    read = {file.relative_to(answers): DIALECTS[2].page(file.read_bytes()) for file in answers.rglob("*.json")}
    assert len(read) > 100
    paged = {str(path) for path, (_, following) in read.items() if following}
    assert {"cfg/EIO/EIO_SIGNAL.json", "misc/iosignals.json", "misc/elog.json"} <= paged


def test_the_event_log_is_read_though_it_is_no_json(answers: Path) -> None:
    content = (answers / "misc" / "elog.json").read_bytes()
    with pytest.raises(json.JSONDecodeError):
        json.loads(content)
    entries = [log_entry("robot", each) for each in DIALECTS[2].page(content)[0]]
    assert len(entries) == 50
    assert {entry.code for entry in entries} >= {41830}


PLACES = {
    "/rw/panel/ctrl-state": "misc/ctrl-state",
    "/rw/rapid/execution": "misc/rapid-execution",
    "/rw/motionsystem/mechunits": "misc/mechunits",
    "/ctrl/identity": "misc/ctrl-identity",
    "/ctrl/network": "misc/ctrl-network",
    "/rw/rapid/tasks": "rapid/_tasks",
}


@pytest.fixture
def controller(answers: Path, monkeypatch: pytest.MonkeyPatch) -> RwsAdministration:
    """Set-up's session with the controller, which answers from its files and has nothing else."""

    async def get(self: RwsClient, path: str, query: object = None) -> list[dict[str, object]]:
        parts = path.split("/")[1:]
        file = PLACES.get(path, f"misc/{parts[-1]}")
        if path.startswith("/rw/cfg/"):
            file = f"cfg/{parts[2]}/{parts[3]}"
        if parts[-1] == "modules":
            file = f"rapid/{parts[3]}/_modules"
        if not (answers / f"{file}.json").exists():
            raise RequestRefused("robot", "not there", "", "NOT_FOUND")
        return DIALECTS[2].page((answers / f"{file}.json").read_bytes())[0]

    async def get_file(self: RwsClient, path: str) -> None:
        return None

    monkeypatch.setattr(RwsClient, "get", get)
    monkeypatch.setattr(RwsClient, "get_file", get_file)
    session = RwsAdministration(RwsAddress.parse("rws://192.168.125.1"))
    monkeypatch.setattr(session.client, "dialect", DIALECTS[2])
    return session


async def test_a_set_up_of_that_controller_finds_nothing_that_stops_it(controller: RwsAdministration) -> None:
    files = program_files(DEPLOYED, 7, called=False, egm="192.168.125.99")
    package = Package.from_files("handeyed", files, RapidNames())
    survey = await read_survey(controller, package.fragments.values(), package.paths, (), "T_ROB1")
    assert list(survey.tasks) == ["SC_CBC", "T_ROB1", "T_GOFA_LED", "T_COMM"]
    assert str(survey.reached) == "192.168.125.1 (X6, Private)"
    needs = findings(survey, task="T_ROB1", unit="ROB_1", serial=False, egm=True, load_is_default=True)
    found = configuration_findings(survey, package) + needs
    assert [each.line() for each in found if each.missing] == []
    assert "payload-mode" not in {each.code for each in found}
    assert "firewall" not in {each.code for each in found}
    plan = plan_setup(survey, package, {}, found, "T_ROB1")
    assert set(plan.load) == {"EIO.cfg", "SYS.cfg", "SIO_egm.cfg"}
    reset = next(step for step in plan.by_hand if "Reset RAPID" in step)
    assert {"T_ROB1/MainModule", "T_COMM/CommModule"} <= set(re.findall(r"\w+/\w+", reset))


async def test_instances_are_known_by_their_content(controller: RwsAdministration) -> None:
    modules = await controller.read_instances("SYS", "CAB_TASK_MODULES")
    assert {each.title for each in modules} == {""}
    assert "CAL_WRIST" in {each.name for each in modules}
    assert all(each.instance_id for each in modules)
    tasks = {each.name: each.attributes for each in await controller.read_instances("SYS", "CAB_TASKS")}
    assert (tasks["T_COMM"]["Type"], tasks["T_COMM"]["Entry"]) == ("SEMISTATIC", "comm")


KINDS = ["EIO_SIGNAL", "EIO_CROSS", "EIO_ACCESS", "SYSSIG_IN", "SYSSIG_OUT", "CAB_TASKS", "CAB_TASK_MODULES",
         "CAB_EXEC_HOOKS", "UDPUC_HOST"]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_the_mock_knows_the_attributes_that_a_controller_lists(answers: Path, kind: str) -> None:
    """The nine system inputs and outputs that every controller brings along stand in SYS, those of a user in EIO."""
    listed = [
        each for file in (answers / "cfg").glob(f"*/{kind}.json") for each in DIALECTS[2].page(file.read_bytes())[0]
    ]
    known = next(filter(None, (attributes_of(domain, kind, 7) for domain in ("EIO", "SYS", "SIO"))))
    assert known == {attribute["_title"] for instance in listed for attribute in instance["attrib"]}


def test_the_fragments_use_what_a_controller_lists(answers: Path) -> None:
    statuses = {
        attribute["value"]
        for instance in DIALECTS[2].page((answers / "cfg" / "SYS" / "SYSSIG_OUT.json").read_bytes())[0]
        for attribute in instance["attrib"]
        if attribute["_title"] == "Status"
    }
    outputs = parse_cfg((DEPLOYED / "rw7" / "EIO.cfg").read_text("ascii")).instances
    ours = {each.attributes["Status"] for each in outputs if each.kind == "SYSSIG_OUT"}
    assert ours - statuses == {"TaskExecuting", "Error"}
