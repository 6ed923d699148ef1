"""Handlers that change the controller, and the table of preconditions: state, mode, execution, mastership; and those of
its files."""

from collections.abc import Mapping
from dataclasses import dataclass

from mock_robot.cabinet.disk import Disk, NoVolume
from mock_robot.cabinet.panel import Mode
from mock_robot.rws import refusals
from mock_robot.rws.context import RequestContext
from mock_robot.rws.equipment import instance_id, listed_title
from mock_robot.rws.exchange import Item, Reply
from mock_robot.rws.mastership import DOMAINS, Consent
from mock_robot.rws.memory import module_name
from mock_robot.rws.refusals import RwsRefused

Parts = Mapping[str, str]


@dataclass(frozen=True)
class Rule:
    """Preconditions of an operation; None: no condition. `master`: the domain whose mastership is needed."""

    states: frozenset[str] | None = None
    execution: str | None = None
    manual: bool = True
    master: str | None = None
    consent_to_execute: bool = False


RULES: Mapping[str, Rule] = {
    "motors on": Rule(states=frozenset({"motoroff", "motoron", "emergencystopreset"}), manual=False),
    "motors off": Rule(),
    "start": Rule(frozenset({"motoron"}), "stopped", master="rapid", consent_to_execute=True),
    "stop": Rule(),
    "program pointer to main": Rule(execution="stopped", master="rapid"),
    "speed ratio": Rule(manual=False, master="rapid"),
    "write RAPID data": Rule(master="rapid"),
    "load or unload a module": Rule(execution="stopped", master="rapid"),
}


def allow(context: RequestContext, act: str) -> None:
    """Check an operation's rule; raises RwsRefused. Order as on the controllers: mode, mastership, state, execution."""
    rule, world = RULES[act], context.world
    if not rule.manual and world.mode is not Mode.AUTO:
        raise RwsRefused(refusals.REJECTED, f"{act}: only in automatic mode")
    if rule.consent_to_execute and not world.mastership.may_execute(context.session, world.mode, context.now_s):
        raise RwsRefused(refusals.REJECTED, f"{act}: the operator has to grant it (RMMP exec)")
    if rule.master is not None:
        context.require_master(rule.master)
    if rule.states is not None and world.controller_state not in rule.states:
        raise RwsRefused(refusals.WRONG_STATE, f"{act}: not in state {world.controller_state}")
    if rule.execution is not None and world.execution_state != rule.execution:
        raise RwsRefused(refusals.WRONG_STATE, f"{act}: not while execution is {world.execution_state}")


def _path(context: RequestContext, name: str) -> str:
    """The canonical path that a form names. Raises RwsRefused."""
    try:
        return context.world.volumes.canonical(context.asked.form.get(name, "").removeprefix("/fileservice/"))
    except NoVolume:
        raise RwsRefused(refusals.NO_PATH) from None


def _content(context: RequestContext, name: str) -> bytes:
    content = context.world.volumes.files.get(_path(context, name))
    if content is None:
        raise RwsRefused(refusals.NO_PATH)
    return content


def _number(context: RequestContext, name: str) -> float:
    try:
        return float(context.asked.form.get(name, ""))
    except ValueError:
        raise RwsRefused(refusals.BAD_ARGUMENT) from None


# --- panel ---


def set_controller_state(context: RequestContext, parts: Parts) -> None:
    wanted = context.asked.form.get("ctrl-state")
    acts = {"motoron": "motors on", "motoroff": "motors off"}
    if wanted not in acts:
        raise RwsRefused(refusals.BAD_ARGUMENT)
    allow(context, acts[wanted])
    context.world.cabinet.switch_motors(wanted == "motoron", context.now_s)


def set_speed_ratio(context: RequestContext, parts: Parts) -> None:
    ratio = _number(context, "speed-ratio")
    if not 0 <= ratio <= 100:
        raise RwsRefused(refusals.BAD_ARGUMENT)
    allow(context, "speed ratio")
    context.world.cabinet.panel.speed_override = ratio / 100


# --- RAPID ---


def start(context: RequestContext, parts: Parts) -> None:
    required = {"regain", "execmode", "cycle", "condition", "stopatbp", "alltaskbytsp"}
    if not required <= context.asked.form.keys():
        raise RwsRefused(refusals.BAD_ARGUMENT, f"Missing {', '.join(sorted(required - context.asked.form.keys()))}")
    allow(context, "start")
    if context.asked.form["cycle"] != "asis":
        context.world.cabinet.panel.cycle = context.asked.form["cycle"]
    context.world.cabinet.run_program(True, context.now_s)
    for program in context.world.programs:
        program()


def stop(context: RequestContext, parts: Parts) -> None:
    if context.asked.form.get("stopmode", "stop") not in ("cycle", "instr", "stop", "qstop"):
        raise RwsRefused(refusals.BAD_ARGUMENT)
    allow(context, "stop")
    if context.version == 2 and context.world.mode is Mode.AUTO:
        context.world.equipment.require("UAS_REMOTE_START_STOP_IN_AUTO")
    if context.world.execution_state == "running":
        context.world.cabinet.run_program(False, context.now_s)


def reset_pointer(context: RequestContext, parts: Parts) -> None:
    allow(context, "program pointer to main")
    context.world.cabinet.move_pointer_to_main(context.now_s)


def write_symbol(context: RequestContext, parts: Parts) -> None:
    _, symbol = context.require_symbol(parts["symbol"])
    if not context.asked.form.get("value"):
        raise RwsRefused(refusals.BAD_ARGUMENT)
    context.world.equipment.require("UAS_RAPID_CURRVALUE")
    allow(context, "write RAPID data")
    try:
        symbol.value = context.asked.form["value"]
    except ValueError as error:
        raise RwsRefused(refusals.BAD_ARGUMENT, str(error)) from None


def select(context: RequestContext, parts: Parts, *, active: bool) -> None:
    """Activate or deactivate a task."""
    task = parts.get("task") or context.asked.form.get("task", "")
    if task not in context.world.tasks:
        raise RwsRefused(refusals.NO_RESOURCE)
    allow(context, "load or unload a module")
    (context.world.memory.inactive.discard if active else context.world.memory.inactive.add)(task)


def load_module(context: RequestContext, parts: Parts) -> None:
    world, task = context.world, parts["task"]
    if task not in world.memory.modules:
        raise RwsRefused(refusals.NO_RESOURCE)
    content = _content(context, "modulepath")
    allow(context, "load or unload a module")
    name = module_name(content)
    if name is None or (name in world.memory.modules[task] and context.asked.form.get("replace", "false") != "true"):
        raise RwsRefused(refusals.BAD_ARGUMENT, "No module in the file, or its name is loaded already")
    world.memory.modules[task][name] = "SysMod" if b"SYSMODULE" in content[:200].upper() else "ProgMod"
    world.cabinet.record(context.now_s, 10044, f"module {name} loaded into {task}")


def unload_module(context: RequestContext, parts: Parts) -> None:
    loaded = context.world.memory.modules.get(parts["task"], {})
    if context.asked.form.get("module") not in loaded:
        raise RwsRefused(refusals.NO_MODULE)
    allow(context, "load or unload a module")
    del loaded[context.asked.form["module"]]


# --- configuration ---


def load_configuration(context: RequestContext, parts: Parts) -> None:
    """Load a file of HOME when it has no duplicates."""
    world, form = context.world, context.asked.form
    if form.get("action-type") not in ("add", "replace", "add-with-reset"):
        raise RwsRefused(refusals.BAD_ARGUMENT)
    content = _content(context, "filepath")
    _allow_configuration(context)
    wrong = world.equipment.load(content.decode("latin-1"))
    if wrong is not None:
        raise RwsRefused(refusals.BAD_ARGUMENT, wrong)
    world.cabinet.record(context.now_s, 10045, "configuration loaded: it acts with the next restart")


def save_configuration(context: RequestContext, parts: Parts) -> None:
    world = context.world
    canonical = _path(context, "filepath")
    if not world.volumes.has_folder(canonical.rpartition("/")[0]):
        raise RwsRefused(refusals.NO_PATH)
    world.equipment.require("UAS_BACKUP")
    world.volumes.files[canonical] = world.equipment.text(parts["domain"]).encode("latin-1")


def back_up(context: RequestContext, parts: Parts) -> Reply:
    """Begin a full backup, whose progress is polled. HOME cannot hold it, nor a name that is taken."""
    world = context.world
    world.equipment.require("UAS_BACKUP")
    folder = _path(context, "backup")
    if folder.startswith("HOME") or world.volumes.has_folder(folder):
        raise RwsRefused(refusals.EXISTS)
    for domain in world.equipment.configuration:
        world.volumes.files[f"{folder}/SYSPAR/{domain}.cfg"] = world.equipment.text(domain).encode("latin-1")
    number = str(len(world.backups) + 1)
    world.backups[number] = "pending"
    return Reply(202, headers=[("location", f"{context.asked.base}progress/{number}")])


def delete_instance(context: RequestContext, parts: Parts) -> None:
    version = context.version
    there = context.world.equipment.configuration.get(parts["domain"].upper(), {}).get(parts["type"], {})
    named = [k for k, each in there.items() if parts["instance"] in (instance_id(k), listed_title(k, each, version))]
    if not named:
        raise RwsRefused(refusals.NO_INSTANCE_1 if context.version == 1 else refusals.NO_RESOURCE)
    _allow_configuration(context)
    del there[named[0]]


def _allow_configuration(context: RequestContext) -> None:
    context.world.equipment.require("UAS_CFG_WRITE")
    context.require_master("cfg")


# --- signals, mastership, consent ---


def write_signal(context: RequestContext, parts: Parts) -> None:
    found = context.world.signal(parts["signal"])
    if found is None:
        raise RwsRefused(refusals.NO_SIGNAL)
    value = _number(context, "lvalue")
    if not found[1].written:
        raise RwsRefused(refusals.REJECTED, "Rejected: the signal's access level allows no remote client")
    context.world.mastership.require(
        context.session, "motion", context.world.mode, context.now_s, explicit=False
    )  # in manual mode with the operator's consent
    if not context.world.cabinet.set_signal(found[0], value):
        found[1].value = value


def domains_of(context: RequestContext, parts: Parts) -> tuple[str, ...]:
    """Mastership domains named by the path, all of them when it names none. `edit` in 2.0 is cfg and rapid."""
    names = {"": DOMAINS, "motion": ("motion",)}
    names |= {"edit": ("cfg", "rapid")} if context.version == 2 else {"cfg": ("cfg",), "rapid": ("rapid",)}
    try:
        return names[parts.get("domain") or ""]
    except KeyError:
        raise RwsRefused(refusals.NO_RESOURCE) from None


def request_mastership(context: RequestContext, parts: Parts) -> None:
    world = context.world
    world.mastership.request(context.session, domains_of(context, parts), world.mode, context.now_s)


def release_mastership(context: RequestContext, parts: Parts) -> None:
    context.world.mastership.release(context.session, domains_of(context, parts))


def mastership(context: RequestContext, parts: Parts) -> Reply:
    holders = [context.world.mastership.holder(domain) for domain in domains_of(context, parts)]
    holder = next((each for each in holders if each is not None), None)
    state = "nomaster" if holder is None else "local" if not holder.abb_cookie else "remote"
    values = {"mastership": state, "uid": "", "application": holder.user if holder else ""}
    return Reply(items=[Item("msh-resource", parts.get("domain") or "mastership", values)])


def ask_consent(context: RequestContext, parts: Parts) -> Reply:
    privilege = context.asked.form.get("privilege", "")
    if privilege not in ("modify", "exec"):
        raise RwsRefused(refusals.BAD_ARGUMENT)
    context.world.mastership.ask_consent(context.session, privilege, context.world.mode, context.now_s)
    return Reply(202, [Item("user-rmmp", "rmmp", {"status": Consent.PENDING.value})])


def poll_consent(context: RequestContext, parts: Parts) -> Reply:
    consent = context.world.mastership.poll_consent(context.session, context.now_s)
    return Reply(items=[Item("user-rmmp-poll", "rmmp", {"status": consent.value})])


def cancel_consent(context: RequestContext, parts: Parts) -> None:
    context.world.mastership.cancel_consent(context.session)


def nothing_to_do(context: RequestContext, parts: Parts) -> None:
    """Accept a request some clients send for bookkeeping; no effect."""


# --- files ---


def read_file(context: RequestContext, parts: Parts) -> Reply:
    path, volumes = _place(context, parts), context.world.volumes
    if path in volumes.files:
        return Reply(content=volumes.files[path])
    items = _listing(volumes, path)
    if items is None:
        raise RwsRefused(refusals.NO_FILE[context.version])
    return Reply(items=items, listed=True)


def write_file(context: RequestContext, parts: Parts) -> Reply:
    """The folder must exist: it is not made."""
    path, files = _place(context, parts), context.world.volumes.files
    context.world.equipment.require("UAS_FTP_WRITE", "UAS_FILE_ACCESS_READ_WRITE")
    if not context.world.volumes.has_folder(path.rpartition("/")[0]):
        raise RwsRefused(refusals.NO_FILE[context.version])
    status = 200 if path in files else 201
    files[path] = context.asked.body
    return Reply(status)


def make_folder(context: RequestContext, parts: Parts) -> Reply:
    """1.0 names the action in the form, 2.0 in the path."""
    parent, volumes, form = _place(context, parts), context.world.volumes, context.asked.form
    name = form.get("fs-newname", "")
    if not name or "/" in name or (context.version == 1 and form.get("fs-action") != "create"):
        raise RwsRefused(refusals.BAD_ARGUMENT, "Invalid/No Query Parameter")
    if not volumes.has_folder(parent):
        raise RwsRefused(refusals.NO_FILE[context.version])
    if volumes.has_folder(f"{parent}/{name}") or f"{parent}/{name}" in volumes.files:
        raise RwsRefused(refusals.EXISTS)
    volumes.folders.add(f"{parent}/{name}")
    return Reply(201 if context.version == 1 else 204)


def delete_file(context: RequestContext, parts: Parts) -> None:
    path, volumes = _place(context, parts), context.world.volumes
    context.world.equipment.require("UAS_FTP_WRITE", "UAS_FILE_ACCESS_READ_WRITE")
    if volumes.files.pop(path, None) is None and path not in volumes.folders:
        raise RwsRefused(refusals.NO_FILE[context.version])
    volumes.folders.discard(path)


def _listing(disk: Disk, folder: str) -> list[Item] | None:
    """Entries of a folder; None when it does not exist."""
    if not disk.has_folder(folder):
        return None
    every = {path[len(folder) + 1 :] for path in (*disk.files, *disk.folders) if path.startswith(folder + "/")}
    files = sorted(name for name in every if f"{folder}/{name}" in disk.files and "/" not in name)
    folders = sorted({name.partition("/")[0] for name in every}.difference(files))
    size = {name: str(len(disk.files[f"{folder}/{name}"])) for name in files}
    return [
        *(Item("fs-dir", name, {}) for name in folders),
        *(Item("fs-file", name, {"fs-size": size[name], "fs-readonly": "false"}) for name in files),
    ]


def _place(context: RequestContext, parts: Parts) -> str:
    try:
        return context.world.volumes.canonical(parts["path"])
    except NoVolume:
        raise RwsRefused(refusals.NO_VOLUME[context.version]) from None
