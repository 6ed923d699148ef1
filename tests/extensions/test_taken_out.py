"""Any one extension is taken out of the closed lists: what is its own is gone, and all the rest answers."""

import re
import tomllib
from http import HTTPStatus
from pathlib import Path
from typing import Any

import httpx
import pytest
import typer
from fastapi.routing import APIRoute

from daemon.api.app import routes
from daemon.api.extension import Extension, Extensions
from daemon.cli.main import command_line
from daemon.cli.output import CommandExtension
from extensions.commands import COMMANDS
from extensions.installed import INSTALLED
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.cli.running import handeyed

ROOT = Path(__file__).parents[2]
PYPROJECT, EXTENSIONS = ROOT / "pyproject.toml", ROOT / "extensions"

each = pytest.mark.parametrize("taken", INSTALLED, ids=lambda extension: extension.name)


def without(taken: Extension) -> Extensions:
    return tuple(extension for extension in INSTALLED if extension is not taken)


def own_routes(extension: Extension) -> set[tuple[str, str]]:
    """Method, in lower case, and path of each."""
    return {
        (method.lower(), route.path)
        for router in extension.routers
        for route in router.routes
        if isinstance(route, APIRoute)
        for method in route.methods
    }


def operations_of(document: dict[str, Any]) -> dict[tuple[str, str], str]:
    """The name of each operation in openapi.json, by method and path."""
    return {
        (method, path): operation["operationId"]
        for path, item in document["paths"].items()
        for method, operation in item.items()
    }


def test_every_extension_has_a_name_of_its_own_and_something_to_add() -> None:
    names = [extension.name for extension in INSTALLED]
    assert len({*names}) == len(names)
    assert {*COMMANDS} <= {*names}
    assert all(own_routes(one) or one.identification or one.sections for one in INSTALLED)


def test_the_contracts_hold_every_extension() -> None:
    contracts = {one["name"]: one for one in tomllib.loads(PYPROJECT.read_text())["tool"]["importlinter"]["contracts"]}
    folders = {f"extensions.{extension.name}" for extension in INSTALLED}

    assert {f"extensions.{file.parent.name}" for file in EXTENSIONS.glob("*/__init__.py")} == folders
    assert {*contracts["An extension knows no other"]["modules"]} == folders
    assert {*contracts["An extension's layers"]["containers"]} == folders
    mathematics = contracts["The mathematics touches no device, clock or framework"]["source_modules"]
    assert {f"extensions.{file.parent.name}.mathematics" for file in EXTENSIONS.glob("*/mathematics")} <= {*mathematics}


@each
def test_openapi_lacks_its_operations_and_no_other(taken: Extension) -> None:
    everything = operations_of(routes(None, INSTALLED).openapi())
    rest = operations_of(routes(None, without(taken)).openapi())
    assert {asked: name for asked, name in everything.items() if asked not in own_routes(taken)} == rest
    assert (rest != everything) is bool(own_routes(taken))


@each
async def test_the_daemon_answers_all_that_is_not_its_own(taken: Extension, tmp_path: Path) -> None:
    """Every page without a parameter, and a calibration with what follows from it."""
    everything = operations_of(routes(None, INSTALLED).openapi())
    asked = [path for method, path in everything if method == "get" and "{" not in path]
    async with serving(
        settings_for(tmp_path, calibration={"policy": "auto", "tolerance_mm": 2.0}), extensions=without(taken)
    ) as bench:
        run = await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
        await bench.verify()
        links = {*(await bench.client.get("/")).json()["links"].values()}
        own = {asked: await code_of(bench.client, *asked) for asked in own_routes(taken)}
        found = {path: await status_of(bench.client, path) for path in links.union(asked)}

    assert run["state"] == "finished", run["cause"]
    assert {*own.values()} <= {"no-such-page"}, own
    missing = {path for path, status in found.items() if status == HTTPStatus.NOT_FOUND}
    assert missing == {path for method, path in own_routes(taken) if method == "get" and "{" not in path}
    assert {path: status for path, status in found.items() if status >= HTTPStatus.INTERNAL_SERVER_ERROR} == {}
    assert not missing & links


async def status_of(client: httpx.AsyncClient, path: str) -> int:
    """Of the answer, whose content may have no end."""
    async with client.stream("GET", path) as answer:
        return answer.status_code


async def code_of(client: httpx.AsyncClient, method: str, path: str) -> str:
    """Of the problem that refuses a request for one of what such a path names."""
    refused = await client.request(method, re.sub(r"\{\w+\}", "x", path), json={})
    return str(refused.json().get("code"))


@each
def test_the_command_line_lacks_its_commands_and_no_other(taken: Extension) -> None:
    rest = command_line({name: other for name, other in COMMANDS.items() if name != taken.name})
    added = COMMANDS.get(taken.name, CommandExtension())
    own = names_in(command_line({taken.name: added})) - names_in(command_line({}))

    assert names_in(rest) == names_in(command_line(COMMANDS)) - own
    for name in own:
        refused = handeyed(name, command_line=rest)
        assert (refused.status, "No such command" in refused.err) == (2, True)
    for option in COMMANDS.get(taken.name, CommandExtension()).after_solve:
        refused = handeyed("solve", "nowhere", option, "x", command_line=rest)
        assert (refused.status, refused.err.partition(": ")[0]) == (2, option), refused.err
        assert "no extension is installed" in refused.err
    for name in names_in(rest) - {"mock"}:  # passes --help on
        assert handeyed(name, "--help", command_line=rest).status == 0


def names_in(app: typer.Typer) -> set[str]:
    return {*typer.main.get_group(app).commands}
