"""Carries a plan out, reads back what was done, and undoes it from its record."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from drivers.errors import DeviceError, RequestRefused
from drivers.robots.abb.rws.administration import RwsAdministration
from drivers.robots.abb.rws.controller_reader import ConfigurationInstance
from drivers.robots.abb.rws.rapid_data import same_value
from drivers.robots.abb.setup.plan import LOAD_MENU, SetupPlan, reset_step
from drivers.robots.abb.setup.survey import ControllerSurvey

VERSION = 1


@dataclass(frozen=True)
class Outcome:
    """One thing done, and whether reading it back agreed."""

    what: str
    ok: bool
    detail: str = ""

    def line(self) -> str:
        """ok    what"""
        return f"{'ok' if self.ok else 'FAIL':<6}{self.what}" + (f": {self.detail}" if self.detail else "")


@dataclass
class SetupRecord:
    """What an installation replaced, from which it is undone. `files`: path to the content before, None without one.

    `instances`: (domain, type, name) that were loaded. `symbols`: values before.
    """

    files: dict[str, bytes | None] = field(default_factory=dict)
    instances: list[tuple[str, str, str]] = field(default_factory=list)
    symbols: dict[str, str] = field(default_factory=dict)
    configuration: dict[str, bytes] = field(default_factory=dict)

    def after(self, earlier: "SetupRecord") -> "SetupRecord":
        """Both as one: what was there before the earlier installation, which this one went on with."""
        return SetupRecord(
            self.files | earlier.files,
            list(dict.fromkeys([*earlier.instances, *self.instances])),
            self.symbols | earlier.symbols,
            self.configuration | earlier.configuration,
        )

    def document(self) -> dict[str, Any]:
        """JSON; contents of files stand beside it, by the names in `files`."""
        return {
            "version": VERSION,
            "files": {path: content is not None for path, content in self.files.items()},
            "instances": [list(each) for each in self.instances],
            "symbols": self.symbols,
            "configuration": sorted(self.configuration),
        }


async def back_up(controller: RwsAdministration, survey: ControllerSurvey, plan: SetupPlan, backup: str) -> SetupRecord:
    """Back up the controller under the name `backup`, and read what the plan replaces or will load.

    Writes only the backup and the saved configuration, beside the modules. Raises DeviceError: nothing was changed.
    """
    if plan.needs_backup:
        await controller.save_backup(backup)
    folder = plan.package.folder
    record = SetupRecord(files={f"{folder}/{name}": survey.files.get(f"{folder}/{name}") for name in plan.writes})
    if plan.load:
        await controller.make_folder(folder)
        for domain in sorted({plan.package.fragments[name].domain for name in plan.load}):
            saved = f"{folder}/{domain}_before.cfg"
            content = await controller.save_configuration(domain, saved)
            if content is not None:
                record.configuration[f"{domain}.cfg"] = content
            record.files[saved] = None
    for fragment in map(plan.package.fragments.__getitem__, plan.load):
        there = {kind: {each.name for each in found} for kind, found in survey.instances.items()}
        wanted = [(fragment.domain, each.kind, each.name) for each in fragment.instances]
        record.instances += [each for each in wanted if each[2] not in there.get("/".join(each[:2]), ())]
    record.symbols = {name: survey.symbols[name] for name in plan.symbols}
    return record


async def install(controller: RwsAdministration, plan: SetupPlan) -> list[Outcome]:
    """Do what the plan says, and read it back. A refusal ends the step, not the rest; it stands in its outcome."""
    outcomes = await _write_files(controller, plan)
    if not all(outcome.ok for outcome in outcomes):
        return outcomes
    for name in plan.load:
        outcomes.append(await _load(controller, plan, name))
    if plan.symbols:
        outcomes += await write_symbols(controller, plan.symbols)
    return outcomes


async def _write_files(controller: RwsAdministration, plan: SetupPlan) -> list[Outcome]:
    folder, outcomes = plan.package.folder, []
    try:
        if plan.writes:
            await controller.make_folder(folder)
        for name in plan.writes:
            content = plan.package.files[name]
            await controller.write_file(f"{folder}/{name}", content)
            same = await controller.read_file(f"{folder}/{name}") == content
            outcomes.append(Outcome(f"HOME:/{folder}/{name}", same, "" if same else "reads back differently"))
    except DeviceError as error:
        outcomes.append(Outcome(f"HOME:/{folder}", False, f"{error.what}: {error.fix}"))
    return outcomes


async def _load(controller: RwsAdministration, plan: SetupPlan, name: str) -> Outcome:
    fragment, path = plan.package.fragments[name], f"{plan.package.folder}/{name}"
    try:
        async with controller.hold_mastership("cfg"):
            await controller.load_configuration(path)
        kinds = {each.kind for each in fragment.instances if "Name" in each.attributes and each.kind != "SYSSIG_OUT"}
        there = {kind: {each.name for each in await controller.read_instances(fragment.domain, kind)} for kind in kinds}
    except DeviceError as error:
        return Outcome(f"load {name}", False, f"{error.what}: {LOAD_MENU}: HOME:/{path}")
    absent = [each.name for each in fragment.instances if each.kind in kinds and each.name not in there[each.kind]]
    return Outcome(f"load {name}", not absent, f"not there: {', '.join(absent)}" if absent else "")


async def write_symbols(controller: RwsAdministration, values: Mapping[str, str]) -> list[Outcome]:
    """Set PERS and read them back."""
    outcomes = []
    try:
        async with controller.hold_mastership("rapid"):
            for name, value in values.items():
                await controller.write_symbol(name, value)
                now = await controller.read_symbol(name)
                same = now is not None and same_value(now, value)
                outcomes.append(Outcome(f"{name} := {value}", same, "" if same else f"reads back {now}"))
    except DeviceError as error:
        outcomes.append(Outcome("settings", False, f"{error.what}: pendant: Program Data, or the next Reset RAPID"))
    return outcomes


async def remove(controller: RwsAdministration, record: SetupRecord) -> list[Outcome]:
    """Undo an installation: settings, configuration, files, in the opposite order.

    The files stay while anything in the configuration names them: the controller would not start without them.
    """
    outcomes: list[Outcome] = []
    if record.symbols:
        outcomes += await write_symbols(controller, record.symbols)
    if record.instances:
        deleted = await _delete_instances(controller, record)
        outcomes += deleted
        if not all(outcome.ok for outcome in deleted):
            return [*outcomes, Outcome("files", False, "kept, since the configuration still names them")]
    for path, content in record.files.items():
        outcomes.append(await _restore_file(controller, path, content))
    for folder in sorted({path.rpartition("/")[0] for path, content in record.files.items() if content is None}):
        if not any(content for path, content in record.files.items() if path.startswith(folder + "/")):
            outcomes.append(await _restore_file(controller, folder, None))
    return outcomes


async def _delete_instances(controller: RwsAdministration, record: SetupRecord) -> list[Outcome]:
    """Delete what was loaded, what names another first, and read back; nothing more once something is left."""
    outcomes: list[Outcome] = []
    try:
        async with controller.hold_mastership("cfg"):
            for domain, kind, name in sorted(record.instances, key=lambda each: each[1] not in NAME_OTHERS):
                if all(outcome.ok for outcome in outcomes):
                    for found in await _named(controller, domain, kind, name):
                        with suppress(RequestRefused):  # what is left is read back
                            await controller.delete_instance(domain, kind, found)
                left = await _named(controller, domain, kind, name)
                by_hand = BY_HAND.format(menu=MENUS.get(domain, domain))
                outcomes.append(Outcome(f"{domain} {kind} {name}", not left, by_hand if left else ""))
    except DeviceError as error:
        outcomes.append(Outcome("configuration", False, f"{error.what}: {error.fix}, then run this again"))
    return outcomes


async def _named(controller: RwsAdministration, domain: str, kind: str, name: str) -> list[ConfigurationInstance]:
    """Instances of that name, or without one and with the name in their title."""
    there = await controller.read_instances(domain, kind)
    return [each for each in there if each.name == name or (name and not each.attributes and name in each.title)]


NAME_OTHERS = ("SYSSIG_OUT", "CAB_TASK_MODULES")
MENUS = {"SYS": "Controller", "EIO": "I/O System", "SIO": "Communication"}
BY_HAND = "delete it by hand (RobotStudio: Configuration, {menu}), then run this again: the files go last"


async def _restore_file(controller: RwsAdministration, path: str, content: bytes | None) -> Outcome:
    try:
        if content is None:
            await controller.delete_file(path)
            return Outcome(f"HOME:/{path} deleted", True)
        await controller.write_file(path, content)
        return Outcome(f"HOME:/{path} restored", await controller.read_file(path) == content)
    except DeviceError as error:
        return Outcome(f"HOME:/{path}", False, f"{error.what}: {error.fix}")


def steps_after_removal(family: int) -> tuple[str, ...]:
    return (reset_step(family), "load the production program again; PP to main; start")
