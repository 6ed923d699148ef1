"""The mock's answers over RWS 1.0 beside what public clients have recorded of controllers: classes, titles, fields.

Facts only, from the tests of abb-rws-client (public repository ichbinmeraj/abb-rws-client, ac0d2d2: a virtual
controller with RobotWare 6.16.2027) and from a public parser of the answers of one with 6.07.1011. What differs stands
in docs/rws.md, with its reason, and nowhere else.
"""

import re
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from mock_robot.rws.memory import Symbol
from tests.conftest import ROOT
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

RATE = "T_ROB1/user/reg1"
POSE = "x y z q1 q2 q3 q4"
SEEN = {
    "/rw/panel/ctrlstate": ("pnl-ctrlstate", "ctrlstate", "ctrlstate"),
    "/rw/panel/opmode": ("pnl-opmode", "opmode", "opmode"),
    "/rw/panel/speedratio": ("pnl-speedratio", "speedratio", "speedratio"),
    "/rw/panel/coldetstate": ("pnl-coldetstate", "collisiondetectstate", "coldetstate"),
    "/rw/rapid/execution": ("rap-execution", "execution", "ctrlexecstate cycle"),
    "/rw/rapid/tasks": ("rap-task-li", "T_ROB1", "name type taskstate excstate active motiontask"),
    "/rw/motionsystem/mechunits/ROB_1/jointtarget": ("ms-jointtarget", "ROB_1", "rax_1 rax_2 rax_3 rax_4 rax_5 rax_6"),
    "/rw/motionsystem/mechunits/ROB_1/robtarget": ("ms-robtargets", "ROB_1", POSE),
    "/rw/motionsystem/mechunits/ROB_1/cartesian": ("ms-mechunit-cartesian", "cartesian", f"{POSE} j1 j4 j6 jx"),
    "/rw/system": ("sys-system-li", "system", "name rwversion sysid starttm rwversionname"),
    "/rw/system/options": ("sys-option-li", "0", "option"),
    "/ctrl/identity": ("ctrl-identity-info", "identity", "ctrl-name ctrl-type ctrl-level"),
    "/ctrl/clock": ("ctrl-clock-info", "clock", "datetime"),
    "/rw/elog/0?lang=en": (
        "elog-message-li", "/rw/elog/0/1", "msgtype code src-name tstamp title desc conseqs causes actions argc",
    ),
    f"/rw/rapid/symbol/data/RAPID/{RATE}": ("rap-data", f"RAPID/{RATE}", "value"),
    f"/rw/rapid/symbol/properties/RAPID/{RATE}": (
        "rap-symproppers", f"RAPID/{RATE}", "symburl symtyp named dattyp ndim local rdonly taskpers typurl",
    ),
    "/rw/iosystem/networks": ("ios-network-li", "Local", "name pstate lstate"),
    "/rw/iosystem/devices": ("ios-device-li", "Local/DRV_1", "name lstate pstate address"),
}  # fmt: skip
"""Class, title and fields of the first entry, by resource. Of targets only the fields of a pose or of joints."""
START = {"regain": "continue", "execmode": "continue", "cycle": "forever", "condition": "none", "stopatbp": "disabled",
         "alltaskbytsp": "false"}  # fmt: skip
MODULE = "/rw/rapid/tasks/T_ROB1"
REFUSED: list[tuple[str, str, dict[str, str] | None, int, int]] = [
    ("POST", "/rw/rapid/execution?action=start", START, 400, -1073442809),
    ("POST", f"{MODULE}?action=loadmod", {"modulepath": "/no-such.mod", "replace": "true"}, 400, -1073438708),
    ("POST", f"{MODULE}?action=unloadmod", {"module": "NoSuchModule"}, 400, -1073442816),
    ("GET", "/fileservice/$HOME/no-such-file-xyz.mod", None, 404, -1073414146),
    ("GET", f"{MODULE}/modules/NoSuchModule", None, 404, -1073414146),
    ("GET", "/rw/iosystem/signals/NoSuchNet/NoSuchDev/NoSuchSig", None, 404, -1073445866),
    ("GET", "/rw/rapid/symbol/data/RAPID/T_ROB1/NoMod/noSym", None, 400, -1073414146),
]


@pytest.fixture(scope="module")
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart() as running:
        running.world.memory.symbols[RATE] = Symbol("num", "42")
        yield running


@pytest.fixture
def client(cell: RwsCell) -> Iterator[httpx.Client]:
    with cell.client_1() as client:
        yield client


def first_entry(xhtml: str) -> tuple[str, str, set[str]]:
    """Class, title, and fields of its own, not of entries within it."""
    kind, title, content = re.findall(r'<li class="([^"]*)" title="([^"]*)">(.*?)</?(?:li|ul)\b', xhtml, re.DOTALL)[0]
    return kind, title, set(re.findall(r'<span class="([^"]*)">', content))


def what_differs(path: str, answer: httpx.Response) -> set[str]:
    kind, title, fields = SEEN[path]
    if answer.status_code == httpx.codes.NOT_FOUND:
        return {"not there"}
    ours = first_entry(answer.text)
    assert ours[0] == kind
    target = path.endswith("target")  # what it has beside a pose or joints was not recorded
    there = ours[2] & set(fields.split()) if target else ours[2]
    return ({"title"} if ours[1] != title else set()) | (there ^ set(fields.split()))


def differences() -> dict[str, set[str]]:
    """The table of docs/rws.md: resource to what differs."""
    text = (ROOT / "docs" / "rws.md").read_text("utf-8").partition("### RWS 1.0 beside recorded answers")[2]
    rows = re.findall(
        r"^\| `(.+?)` \| (.+?) \| .+ \|$", text.partition("\n## ")[0].partition("\n### ")[0], re.MULTILINE
    )
    return {path: set(re.findall(r"`([^`]+)`", what)) or {what} for path, what in rows}


def test_each_answer_has_the_class_title_and_fields_of_a_controllers(client: httpx.Client) -> None:
    found = {path: what_differs(path, client.get(path)) for path in SEEN}
    assert {path: what for path, what in found.items() if what} == differences()


def test_an_attribute_of_the_configuration_is_an_entry_within_its_instance(client: httpx.Client) -> None:
    text = client.get("/rw/cfg/SYS/SYS_MISC/instances").text
    assert '<li class="cfg-ia-t" title="Value"><span class="value">4</span></li>' in text


@pytest.mark.parametrize(("method", "path", "form", "status", "code"), REFUSED, ids=[row[1] for row in REFUSED])
def test_a_refusal_has_the_status_and_code_of_a_controllers(
    client: httpx.Client, method: str, path: str, form: dict[str, str] | None, status: int, code: int
) -> None:
    answer = client.request(method, path, data=form)
    said: Any = re.search(r'<div class="status"><span class="code">(-\d+)</span><span class="msg">', answer.text)
    assert (answer.status_code, int(said[1])) == (status, code)
