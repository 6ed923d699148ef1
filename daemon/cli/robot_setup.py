"""`handeyed robot setup` and `handeyed robot remove`: install the robot program over Robot Web Services, or undo it."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.errors import CommandError, ExitStatus, UnreadableInput
from daemon.cli.output import Json, print_answer

if TYPE_CHECKING:
    from drivers.robots.abb.rapid_names import RapidNames
    from drivers.robots.abb.rws.address import RwsAddress
    from drivers.robots.abb.setup.installer import Outcome, SetupRecord
    from drivers.robots.abb.setup.plan import SetupPlan
    from drivers.robots.abb.setup.requirements import Finding
    from drivers.robots.abb.setup.survey import ControllerSurvey


RECORD = "setup.json"
SHOWN = ("name", "robotware", "virtual", "mode", "execution", "options", "grants", "tasks", "units", "base_frame",
         "mastership")  # fmt: skip
"""What --json gives of the controller."""
Address = Annotated[str, typer.Argument(help="rws://host, rws://user:password@host:port?version=2")]
Yes = Annotated[bool, typer.Option("--yes", help="Do not ask for consent.")]


def setup(
    address: Address,
    modules: Annotated[Path | None, typer.Option(help="The RAPID modules; default: those of this release.")] = None,
    to: Annotated[str, typer.Option(help="The folder within HOME: on the controller.")] = "handeyed",
    setting: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A setting of CELL_shared.sys; repeatable.")
    ] = None,
    task: Annotated[str, typer.Option(help="The motion task.")] = "T_ROB1",
    link_task: Annotated[str, typer.Option(help="The task of the link.")] = "T_HANDEYED",
    port: Annotated[int, typer.Option(min=1025, max=4999, help="TCP port of the link.")] = 4242,
    prefix: Annotated[str, typer.Option(help="What all names begin with: another one for a second arm.")] = "cell",
    called: Annotated[bool, typer.Option("--called", help="Your own main calls the motion part.")] = False,
    egm: Annotated[str | None, typer.Option(metavar="HOST", help="EGM is wanted, sent to this PC's address.")] = None,
    backup: Annotated[Path | None, typer.Option(help="Folder of the backup; default: a new one here.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show findings and plan; change nothing.")] = False,
    yes: Yes = False,
    json: Json = False,
) -> None:
    """Install the robot program on a controller: look, plan, ask, back up, write, load, set, read back.

    Says first what the controller lacks, with ABB's option numbers and menus, and changes nothing then. What a program
    cannot do (Reset RAPID, PP to main) is listed as steps. `handeyed robot remove` undoes it from the backup.

    Exit status: 0 done, or nothing to do; 1 something is missing or was refused; 2 the modules cannot be read.
    """
    import asyncio

    from drivers.robots.abb.rapid_names import RapidNames

    values = dict(_setting(each) for each in setting or ())
    where = rws_address(address)
    names = RapidNames(task, link_task, where.mechunit, port, prefix)
    wish = _Wish(to, values, names, called, egm, backup, dry_run, yes, json)
    asyncio.run(_setup(where, module_folder(modules), wish))


def remove(
    address: Address,
    backup: Annotated[Path, typer.Option(help="The backup that `handeyed robot setup` made.")],
    yes: Yes = False,
    json: Json = False,
) -> None:
    """Undo `handeyed robot setup` from its backup: settings, configuration and files are as before.

    Exit status: 0 all is as before, 1 a step was refused and is named, 2 the backup cannot be read.
    """
    import asyncio

    record = _read_record(backup)
    if not (yes or typer.confirm(f"Undo {backup}: {len(record.files)} files?", default=False, err=True)):
        raise CommandError(address, "nothing was changed", "consent to it, or give --yes")
    outcomes, family = asyncio.run(_remove(rws_address(address), record))
    from drivers.robots.abb.setup.installer import steps_after_removal

    undone = all(each.ok for each in outcomes)
    # Reset RAPID after half a removal would take programs for nothing.
    steps = steps_after_removal(family) if undone else ()
    lines = [*(each.line() for each in outcomes), *(f"by hand  {step}" for step in steps)]
    print_answer(json, {"done": [vars(each) for each in outcomes], "by_hand": steps}, "\n".join(lines))
    raise typer.Exit(ExitStatus.OK if undone else ExitStatus.FAILED)


@dataclass(frozen=True)
class _Wish:
    """What the command line asks for."""

    folder: str
    settings: dict[str, str]
    names: "RapidNames"
    called: bool
    egm: str | None
    backup: Path | None
    dry_run: bool
    yes: bool
    json: bool


async def _setup(where: "RwsAddress", modules: Path, wish: _Wish) -> None:
    from drivers.robots.abb.rws.administration import RwsAdministration
    from drivers.robots.abb.setup.installer import SetupRecord, back_up, install
    from drivers.robots.abb.setup.plan import Package, configuration_findings, plan_setup
    from drivers.robots.abb.setup.requirements import findings
    from drivers.robots.abb.setup.settings import module_name
    from drivers.robots.abb.setup.survey import read_networks, read_survey

    async with RwsAdministration(where) as controller:
        task = wish.names.motion_task
        files = program_files(modules, {1: 6, 2: 7}[controller.version], called=wish.called, egm=wish.egm)
        package = Package.from_files(wish.folder, files, wish.names)
        _, reached = await read_networks(controller)
        here = {"cell_address": reached.address} if reached else {}
        values = {package.names.rename(name): value for name, value in (here | wish.settings).items()}
        wanted = package.with_settings(values)  # a setting that cannot be is refused before anything is read
        names = [f"{module_name(package.shared)}/{name}" for name in values]
        survey = await read_survey(controller, package.fragments.values(), package.paths, names, task)
        found = configuration_findings(survey, wanted) + findings(
            survey,
            task=task,
            unit=where.mechunit,
            serial=wanted.setting("cell_use_serial").upper() == "TRUE",
            egm=wish.egm is not None,
            load_is_default=wanted.load_is_default,
        )
        plan = plan_setup(survey, package, values, found, task)
        document = _document(where.address, survey, found, plan)
        _show(document, survey, found, plan, wish)
        if any(finding.missing for finding in found):
            raise CommandError(where.address, "nothing was changed", "see what is MISSING above")
        if wish.dry_run or not plan.changes_anything:
            return
        name = _backup_name(survey.name)
        if not (wish.yes or typer.confirm("Do it?", default=False, err=True)):
            raise CommandError(where.address, "nothing was changed", "consent to it, or give --yes")
        folder = wish.backup or Path(name)
        earlier = _read_record(folder) if (folder / RECORD).exists() else SetupRecord()
        record = (await back_up(controller, survey, plan, name)).after(earlier)
        _write_record(folder, record)
        typer.echo(f"backup in {folder}: cut off, go on with --backup {folder}", err=True)
        outcomes = await install(controller, plan)
    done: dict[str, Any] = {"done": [vars(each) for each in outcomes], "backup": str(folder)}
    done["controller_backup"] = name if plan.needs_backup else None
    _finish(document | done, outcomes, plan, wish)


async def _remove(where: "RwsAddress", record: "SetupRecord") -> "tuple[list[Outcome], int]":
    from drivers.robots.abb.rws.administration import RwsAdministration
    from drivers.robots.abb.setup.installer import remove

    async with RwsAdministration(where) as controller:
        return await remove(controller, record), {1: 6, 2: 7}[controller.version]


# --- what is shown ---


def _show(
    document: dict[str, Any], survey: "ControllerSurvey", found: "Iterable[Finding]", plan: "SetupPlan", wish: _Wish
) -> None:
    missing = any(finding.missing for finding in found)
    if wish.json and (wish.dry_run or missing or not plan.changes_anything):
        typer.echo(dumps(document))
    if wish.json:
        return
    typer.echo(f"{document['address']}: " + "\n  ".join(survey.summary()))
    for finding in found:
        typer.echo(finding.line())
    if missing:
        return
    typer.echo("\n".join(plan.lines()))
    if not plan.changes_anything:
        typer.echo("everything is there; nothing was changed")


def _finish(document: dict[str, Any], outcomes: "list[Outcome]", plan: "SetupPlan", wish: _Wish) -> None:
    address, folder, whole = document["address"], document["backup"], document["controller_backup"]
    complete = all(each.ok for each in outcomes)
    steps = plan.by_hand if complete else ()
    if wish.json:
        typer.echo(dumps(document | {"by_hand": steps}))
    else:
        typer.echo("\n".join(each.line() for each in outcomes))
        if whole:
            typer.echo(f"backup   of the whole controller, on its disk: BACKUP/{whole}")
        typer.echo(f"backup   {folder} (handeyed robot remove {address} --backup {folder})")
        typer.echo("".join(f"by hand  {number}. {step}\n" for number, step in enumerate(steps, 1)), nl=False)
    if not complete:
        what, fix = "not all was done", f"mend what FAIL names, then run this again with --backup {folder}"
        raise CommandError(address, what, fix)


def _document(
    address: str, survey: "ControllerSurvey", found: "Iterable[Finding]", plan: "SetupPlan"
) -> dict[str, Any]:
    return {
        "address": address,
        "controller": {**{name: getattr(survey, name) for name in SHOWN}, "state": survey.controller},
        "findings": [vars(finding) for finding in found],
        "plan": {"write": plan.writes, "replace": plan.replaced, "load": plan.load, "set": plan.symbols},
        "by_hand": plan.by_hand,
    }


# --- files and arguments ---


def rws_address(address: str) -> "RwsAddress":
    """The address of Robot Web Services, also as http(s):// or a host alone. Raises AddressNotUnderstood."""
    from drivers.robots.abb.rws.address import RwsAddress

    return RwsAddress.parse(re.sub(r"^https?://|^(?!\w+://)", "rws://", address))


def _setting(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise UnreadableInput(text, "this is no setting", "write NAME=VALUE")
    return name.strip(), value


def _backup_name(name: str) -> str:
    from datetime import UTC, datetime

    plain = re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-") or "controller"
    return f"handeyed-setup-{plain}-{datetime.now(UTC):%Y%m%d-%H%M%S}"


def _write_record(folder: Path, record: "SetupRecord") -> None:
    try:
        (folder / "HOME").mkdir(parents=True, exist_ok=True)
        for path, content in record.files.items():
            if content is not None:
                (folder / "HOME" / path).parent.mkdir(parents=True, exist_ok=True)
                (folder / "HOME" / path).write_bytes(content)
        for name, content in record.configuration.items():
            (folder / name).write_bytes(content)
        (folder / RECORD).write_text(dumps(record.document(), indent=2))
    except OSError as error:
        raise CommandError(str(folder), error.strerror or str(error), "name another folder with --backup") from None


def _read_record(folder: Path) -> "SetupRecord":
    from calibration.documents.validation import parse_document
    from calibration.errors import DocumentError
    from daemon.runtime.bounded_read import read_bounded
    from daemon.tools.setup_record import SetupRecordDocument
    from drivers.robots.abb.setup.installer import SetupRecord

    home = folder / "HOME"
    try:
        contents = {str(p.relative_to(home)): read_bounded(p) for p in sorted(home.rglob("*")) if p.is_file()}
        kept = parse_document(SetupRecordDocument, read_bounded(folder / RECORD), str(folder / RECORD))
        files = {path: contents[path] if existed else None for path, existed in kept.files.items()}
        before = {name: read_bounded(folder / name) for name in kept.configuration}
        return SetupRecord(files, kept.instances, kept.symbols, before)
    except (OSError, KeyError, DocumentError) as error:
        raise UnreadableInput(str(folder), f"no backup of a setup ({error})", "name the folder that it made") from None


SUFFIXES = (".mod", ".sys", ".cfg")
_ROOT = Path(__file__).parents[2]
PLACES = (_ROOT / "deploy" / "rapid", _ROOT / "mock_robot" / "rapid" / "modules")
"""In the repository, and as the wheel holds them."""


def module_folder(given: Path | None) -> Path:
    """The folder given, or that of this release's modules. Raises CommandError without any."""
    found = given or next((place for place in PLACES if (place / "CELL_shared.sys").exists()), None)
    if found is None:
        raise UnreadableInput("the modules", "they are not installed here", "give --modules deploy/rapid")
    return found


def module_files(folder: Path, *, modules: bool = True) -> dict[str, bytes]:
    """Files of a folder that a controller loads, by name. Raises CommandError when `modules` are wanted and absent."""
    from daemon.runtime.bounded_read import read_bounded

    if not (modules or folder.is_dir()):
        return {}
    try:
        found = {path.name: read_bounded(path) for path in sorted(folder.iterdir()) if path.suffix in SUFFIXES}
    except OSError as error:
        raise UnreadableInput(str(folder), error.strerror or str(error), "name the folder of the modules") from None
    if modules and not any(name.endswith((".mod", ".sys")) for name in found):
        raise UnreadableInput(str(folder), "no RAPID module is in it", "name deploy/rapid")
    return found


EGM_HOST = b"192.168.125.99"
"""The PC's address in the fragments for EGM, as delivered."""


def program_files(folder: Path, robotware: int, *, called: bool, egm: str | None) -> dict[str, bytes]:
    """Modules and fragments that an installation loads, by name.

    `called`: a main of the customer's calls the motion part, so that there is no CELL_main; `egm`: this PC's address
    for position streams, None without them. Raises CommandError.
    """
    fragments = folder / f"rw{robotware}"
    files = module_files(folder) | module_files(fragments, modules=False)
    if called:
        files |= module_files(fragments / "called", modules=False)
        files.pop("CELL_main.mod", None)
    if egm is None:
        files.pop("CELL_egm.mod", None)
        return files
    for name, content in module_files(fragments / "egm", modules=False).items():
        files[name.replace(".cfg", "_egm.cfg")] = content.replace(EGM_HOST, egm.encode("ascii", "replace"))
    return files
