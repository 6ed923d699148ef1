"""Lengths and positions in the RAPID against the tables of protocols.cb."""

import re
from pathlib import Path

from protocols.cb.codes import Status
from protocols.cb.layouts import REQUESTS, STRUCTS

RAPID = Path(__file__).parents[3] / "deploy" / "rapid"
EXAMPLE = RAPID.parent / "handeyed.example.toml"


def test_every_request_has_the_length_of_the_link() -> None:
    found = re.findall(r"CASE (\d+):\s+RETURN (\d+);", (RAPID / "CELL_comm.mod").read_text("ascii"))
    assert {int(command): int(length) for command, length in found} == {
        int(command): STRUCTS[kind].size for command, kind in REQUESTS.items()
    }


def test_every_status_has_the_number_of_the_link() -> None:
    text = (RAPID / "CELL_shared.sys").read_text("ascii")
    found = re.findall(r"CONST num CB_\w+ := (\d+);", text)
    assert [int(number) for number in found] == [int(status) for status in Status]


def test_the_daemon_dials_where_the_program_listens() -> None:
    port = re.findall(r"cell_port := (\d+);", (RAPID / "CELL_shared.sys").read_text("ascii"))
    address = re.findall(r'(?m)^address = "tcp://[\d.]+:(\d+)"$', EXAMPLE.read_text())
    assert address == port
    assert 1025 <= int(port[0]) <= 4999, "the ports that a controller leaves to programs"
