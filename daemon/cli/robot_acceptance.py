"""`handeyed robot acceptance`: every assumption about a controller, checked on the wire in one guided program."""

from collections.abc import Callable, Iterable, Mapping
from json import dumps, loads
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.errors import CommandError, ExitStatus, UnreadableInput
from daemon.cli.output import Json, print_answer, writing

if TYPE_CHECKING:
    from drivers.robots.abb.acceptance.bench import Bench
    from drivers.robots.abb.acceptance.person import Answer, Person, Step
    from drivers.robots.abb.acceptance.program import Row, RowResult

SECONDS = "Seconds, or a number, of AcceptanceLimits; repeatable: --limit idle_s=3600 --limit reads=1000."


def acceptance(
    address: Annotated[str, typer.Argument(help="The CB link: tcp://host:4242, serial:///dev/ttyUSB0.")],
    services: Annotated[str | None, typer.Option(help="Robot Web Services: rws://host. Without: fewer rows.")] = None,
    report: Annotated[Path, typer.Option(help="The report, .html and .json beside it.")] = Path("acceptance.html"),
    only: Annotated[list[str] | None, typer.Option(help="Only this row; repeatable.")] = None,
    limit: Annotated[list[str] | None, typer.Option(metavar="NAME=NUMBER", help=SECONDS)] = None,
    operator: Annotated[
        str | None, typer.Option(metavar="URL", help="A mock cell's control port, which does what a person would.")
    ] = None,
    list_rows: Annotated[bool, typer.Option("--list", help="List the rows; connect to nothing.")] = False,
    json: Json = False,
) -> None:
    """Check a controller, row by row: THE ROBOT MOVES. You are asked for what a program cannot do.

    Enter: done. n: no, it is not so. s: skip this row.

    Exit status: 0 no row failed, 1 one did, or none could be tried.
    """
    import asyncio

    from daemon.tools.acceptance_report import acceptance_page
    from drivers.robots.abb.acceptance.program import ROWS

    rows = [row for row in ROWS if not only or row.code in only]
    if unknown := sorted(set(only or ()) - {row.code for row in ROWS}):
        raise UnreadableInput(unknown[0], "there is no such row", "--list names them")
    if list_rows:
        typer.echo("\n".join(f"{row.code:<18}{row.assumption}" for row in rows))
        return
    document = asyncio.run(_run(address, services, rows, _limits(limit or []), operator, quiet=json))
    with writing(report, "name another file with --report"):
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(acceptance_page(document), encoding="utf-8")
        report.with_suffix(".json").write_text(dumps(document, indent=2), encoding="utf-8")
    counts = ", ".join(f"{number} {verdict}" for verdict, number in document["counts"].items())
    print_answer(json, document, f"{counts}; {report}, {report.with_suffix('.json')}")
    raise typer.Exit(ExitStatus.OK if document["accepted"] else ExitStatus.FAILED)


async def _run(
    address: str, services: str | None, rows: "list[Row]", limits: Any, operator: str | None, *, quiet: bool
) -> dict[str, Any]:
    from drivers.registry import cb_transport
    from drivers.robots.abb.acceptance.bench import Bench
    from drivers.robots.abb.rws.address import RwsAddress

    person: Person = Operator(operator) if operator else Terminal()
    where = RwsAddress.parse(services) if services else None
    bench = Bench(cb_transport(address), where, person, limits)
    return await accept(bench, rows, lambda result: typer.echo(result.line(), err=quiet))


async def accept(bench: "Bench", rows: "Iterable[Row]", note: "Callable[[RowResult], None]") -> dict[str, Any]:
    """The report of these rows; `note` gets each result as it is there."""
    from datetime import UTC, datetime
    from importlib.metadata import version

    from daemon.tools.acceptance_report import acceptance_document
    from drivers.robots.abb.acceptance.program import head, run_rows

    began_at = f"{datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC"
    controller = await head(bench)
    return acceptance_document(
        [vars(result) for result in await run_rows(bench, rows, note)],
        handeyed=version("handeyed"),
        began_at=began_at,
        address=bench.transport.address,
        services=None if bench.services is None else bench.services.address,
        controller=dict(controller),
        event_log=await _event_log(bench),
    )


async def _event_log(bench: "Bench") -> list[dict[str, Any]]:
    """The newest entries; [] when they cannot be read."""
    from drivers.errors import DeviceError

    if bench.services is None:
        return []
    try:
        async with bench.robot_services() as robot:
            return [vars(entry) for entry in await robot.read_event_log()]
    except DeviceError:
        return []


def _limits(given: list[str]) -> Any:
    from dataclasses import fields

    from drivers.robots.abb.acceptance.bench import AcceptanceLimits

    kinds = {field.name: int if field.name in ("reads", "samples", "repeats", "egm_port") else float
             for field in fields(AcceptanceLimits)}  # fmt: skip
    values: dict[str, Any] = {}
    for each in given:
        name, _, number = each.partition("=")
        try:
            values[name] = kinds[name](number)
        except (KeyError, ValueError):
            raise UnreadableInput(each, "this is no limit", f"write one of {', '.join(kinds)}=NUMBER") from None
    return AcceptanceLimits(**values)


class Terminal:
    """A person at the terminal."""

    async def do(self, step: "Step") -> "Answer":
        """Show the instruction, and wait for Enter unless it is for now."""
        import asyncio

        from drivers.robots.abb.acceptance.person import Answer

        if step.now:
            typer.echo(f"\a>>> {step.text}", err=True)
            return Answer.DONE
        prompt = f">>> {step.text}  [Enter: done, n: no, s: skip] "
        given = (await asyncio.to_thread(typer.prompt, prompt, "", show_default=False, err=True)).strip().lower()
        return {"n": Answer.NO, "s": Answer.SKIP}.get(given, Answer.DONE)


class Operator:
    """The control port of a mock cell, which turns the switches that a person would."""

    ACTS: Mapping[str, list[tuple[str, str, dict[str, Any]]]] = loads(
        Path(__file__).with_suffix(".json").read_text("utf-8")
    )
    """Requests by the code of a step; a step without any is only answered."""

    def __init__(self, url: str) -> None:
        self._url = url.rstrip("/")

    async def do(self, step: "Step") -> "Answer":
        """Turn the switches. Raises CommandError when the control port does not answer."""
        import httpx

        from drivers.robots.abb.acceptance.person import Answer

        tls = self._url.startswith("https:")  # reading the authorities takes 40 ms, which plain HTTP needs not
        async with httpx.AsyncClient(base_url=self._url, trust_env=False, timeout=20.0, verify=tls) as client:
            for method, path, body in self.ACTS.get(step.code, ()):
                try:
                    answer = await client.request(method, path, json=body)
                    answer.raise_for_status()
                except httpx.HTTPError as error:
                    raise CommandError(self._url, f"{path}: {error}", "give a mock cell's control port") from None
        return Answer.DONE
