"""What the robot program needs of a controller, and where ABB has it: options, grants, mode, mastership.

Option numbers and menus: ABB's product specifications of IRC5 (3HAC048264) and OmniCore (3HAC065034), and the public
projects that docs/rapid.md names. Names of grants: as Robot Web Services list them.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from drivers.robots.abb.setup.survey import FIREWALL, MISCELLANEOUS, ControllerSurvey

FULL_ACCESS = "UAS_FULL_ACCESS"
UAS = {
    6: "RobotStudio: Controller, Authenticate, Edit User Accounts, Groups",
    7: "RobotStudio: Controller, Authenticate, Edit User Accounts, Roles",
}
OPTIONS_MENU = {6: "System Info, System properties, Options", 7: "Settings, System, Options"}


@dataclass(frozen=True)
class Finding:
    """Something an installation has to know. `missing`: without it nothing is changed."""

    code: str
    missing: bool
    what: str
    fix: str

    def line(self) -> str:
        """MISSING what: what to do"""
        return f"{'MISSING' if self.missing else 'note':<8}{self.what}: {self.fix}"


@dataclass(frozen=True)
class Right:
    """A grant that an act needs, by its names on RobotWare 6 and 7, and what goes without it."""

    code: str
    names: tuple[str, ...]
    shown: str
    without: str
    missing: bool = False

    def is_held(self, survey: ControllerSurvey) -> bool:
        """Whether the user has it; TRUE where the controller does not list grants."""
        return survey.grants is None or bool({FULL_ACCESS, *self.names} & set(survey.grants))


WRITE_FILES = Right(
    "grant-files",
    ("UAS_FTP_WRITE", "UAS_FILE_ACCESS_READ_WRITE"),
    "Write access to controller disks",
    "no file can be written",
    missing=True,
)
WRITE_CONFIGURATION = Right(
    "grant-configuration", ("UAS_CFG_WRITE",), "Modify configuration", "the fragments are loaded by hand"
)
WRITE_DATA = Right(
    "grant-data",
    ("UAS_RAPID_CURRVALUE", "UAS_RAPID_EDIT"),
    "Modify current value",
    "settings in use change with the next Reset RAPID",
)
WRITE_BACKUP = Right("grant-backup", ("UAS_BACKUP",), "Backup and save", "nothing is changed without a backup", True)
RESTART = Right(
    "grant-restart",
    ("UAS_SYSTEM_ADMINISTRATION",),
    "Administration of installed systems",
    "Reset RAPID is done by somebody who has it",
)
REMOTE_STOP = Right(
    "grant-remote-stop",
    ("UAS_REMOTE_START_STOP_IN_AUTO",),
    "Remote Start and Stop in Auto",
    "[robot] stop_address is refused when it is needed",
)
RIGHTS = (WRITE_FILES, WRITE_BACKUP, WRITE_CONFIGURATION, WRITE_DATA, RESTART)
FIREWALL_MENU = "RobotStudio: Configuration, Communication, Firewall Manager"
DOORS = {"RapidSockets": "the link does not answer", "UDPUC": "no position stream leaves the controller"}
"""Services of the firewall that an installation needs, and what is without them."""


def findings(
    survey: ControllerSurvey, *, task: str, unit: str, serial: bool, egm: bool, load_is_default: bool
) -> tuple[Finding, ...]:
    """All findings, those that forbid an installation first.

    `serial`: the link goes over a serial line; `egm`: EGM is wanted; `load_is_default`: the tool load is the 1 gram of
    tool0.
    """
    found = [
        *_system(survey),
        *_options(survey, serial=serial, egm=egm),
        *_networks(survey, serial=serial, egm=egm),
        *_units(survey, task, unit),
        *_rights(survey),
        *_state(survey),
        *_frames(survey),
        *_load(survey, load_is_default=load_is_default),
    ]
    return tuple(sorted(found, key=lambda finding: not finding.missing))


def _system(survey: ControllerSurvey) -> Iterable[Finding]:
    if survey.family not in (6, 7):
        what = f"RobotWare {survey.robotware} is neither 6 nor 7"
        fix = "copy the files with `handeyed robot upload` and load them in RobotStudio; no fragment is known to fit"
        yield Finding("robotware", True, what, fix)
    if survey.virtual:
        what = "this is RobotStudio's virtual controller"
        fix = "its link answers at 127.0.0.1; run the daemon on the same PC, and allow both through Windows' firewall"
        yield Finding("virtual", False, what, fix)


def _options(survey: ControllerSurvey, *, serial: bool, egm: bool) -> Iterable[Finding]:
    second = "623-1 Multitasking" if survey.family == 6 else "3114-1 Multitasking"
    menu = f"what there is: pendant, {OPTIONS_MENU.get(survey.family, OPTIONS_MENU[7])}; ABB sells it as an option key"
    if survey.options is None:
        needed = f"616-1 PC Interface and {second} are" if survey.family == 6 else f"{second} is"
        yield Finding("options", False, "the controller does not list its options", f"{needed} needed; {menu}")
        return
    if not _has(survey.options, second, "multitasking"):
        yield Finding("multitasking", True, f"option {second} is missing: no second task", menu)
    socket = _has(survey.options, "616-1 PC Interface", "pc interface") or _has(survey.options, "672-1", "socket mess")
    if survey.family == 6 and not (socket or serial):
        what = "option 616-1 PC Interface is missing: no sockets, and Robot Web Services at the service port only"
        fix = f"use a serial line (--set cell_use_serial=TRUE), or calibrate by hand over rws://; {menu}"
        yield Finding("pc-interface", True, what, fix)
    guided = "689-1 Externally Guided Motion" if survey.family == 6 else "3124-1 Externally Guided Motion"
    if egm and not _has(survey.options, guided, "externally guided"):
        yield Finding("egm", True, f"option {guided} is missing: no [robot.egm]", menu)


def _networks(survey: ControllerSurvey, *, serial: bool, egm: bool) -> Iterable[Finding]:
    at = survey.reached
    if survey.networks and not (serial or survey.virtual):
        listed = ", ".join(map(str, survey.networks))
        where = f"{at}: set-up lets the link listen there" if at else f"none of its own addresses: {listed}"
        fix = "another one of its addresses: --set cell_address=..."
        yield Finding("address", False, f"the controller was reached at {where}", fix)
    kinds = ["Public", "Private", "I/O"] if at is None else [at.kind]
    for door in survey.instances.get(FIREWALL, ()):
        switches = {kind: f"EnableOn{kind.replace('/', '')}Net" for kind in kinds}
        closed = all(door.attributes.get(name, "").lower() == "false" for name in switches.values())
        if closed and door.name in DOORS and not (serial if door.name == "RapidSockets" else not egm):
            where = " or ".join(kinds)
            what = f"the firewall lets {door.name} through on no {where} network: {DOORS[door.name]}"
            fix = f"{FIREWALL_MENU}: {door.name}, {' or '.join(switches.values())} Yes; restart"
            yield Finding("firewall", False, what, fix)


def _has(options: Iterable[str], number_and_name: str, word: str) -> bool:
    number = number_and_name.partition(" ")[0]
    return any(number in option.split() or word in option.lower() for option in options)


def _units(survey: ControllerSurvey, task: str, unit: str) -> Iterable[Finding]:
    if survey.tasks and task not in survey.motion_tasks:
        what = f"no motion task is named {task}: there are {', '.join(survey.motion_tasks) or 'none'}"
        yield Finding("task", True, what, "name it with --task, and in the fragments and settings of deploy/rapid")
    if survey.units and unit not in survey.units:
        what = f"no mechanical unit is named {unit}: there are {', '.join(survey.units)}"
        yield Finding("unit", True, what, "name it in the address: rws://HOST?mechunit=NAME")
    own = [name for name in survey.modules.get(task, ()) if not name.upper().startswith(("CELL_", "BASE", "USER"))]
    if own:
        what = f"{task} holds {', '.join(own)}"
        yield Finding("other-modules", False, what, "a task has one main: --called, when that program is to stay")


def _rights(survey: ControllerSurvey) -> Iterable[Finding]:
    menu = UAS.get(survey.family, UAS[7])
    needed: tuple[Right, ...] = (*RIGHTS, REMOTE_STOP) if survey.family >= 7 else RIGHTS
    for right in needed:
        if not right.is_held(survey):
            what = f"the user has no grant {right.shown!r}: {right.without}"
            yield Finding(right.code, right.missing, what, f"{menu}: give it, then log in again")


def _state(survey: ControllerSurvey) -> Iterable[Finding]:
    if survey.mode and survey.mode != "AUTO":
        what = f"the controller is in manual mode ({survey.mode}): configuration and data are written in AUTO only"
        yield Finding("manual-mode", False, what, "switch to AUTO, or do those steps at the pendant")
    if survey.mastership in ("remote", "local"):
        where = "the pendant" if survey.mastership == "local" else "another client, or a set-up cut off 5 minutes ago,"
        fix = "RobotStudio: Controller, Release Write Access; at the pendant log off; or do the steps listed by hand"
        yield Finding("mastership", False, f"{where} holds the write access", fix)
    if survey.mastership is None and survey.family >= 8:
        yield Finding("mastership", False, "RobotWare 8 has no mastership", "load in RobotStudio")


def _load(survey: ControllerSurvey, *, load_is_default: bool) -> Iterable[Finding]:
    for each in survey.instances.get(MISCELLANEOUS, ()):
        if each.name == "ModalPayLoadMode" and each.attributes.get("Value") == "0":
            what = "ModalPayLoadMode is 0: the program's GripLoad stops with an error"
            fix = "RobotStudio: Configuration, Controller, General RAPID: ModalPayLoadMode 1, when no program needs 0"
            yield Finding("payload-mode", True, what, fix)
    if load_is_default:
        what = "the load of cell_flange is the 1 gram of tool0: arming is refused with NO_LOAD"
        fix = "pendant: Program Editor, Debug, Call Routine, LoadIdentify; then --set cell_flange=... before it moves"
        yield Finding("tool-load", False, what, fix)


def _frames(survey: ControllerSurvey) -> Iterable[Finding]:
    if not survey.base_at_world and survey.base_frame is not None:
        shown = ", ".join(f"{value:.6g}" for value in survey.base_frame)
        what = f"the base frame is not the world frame: [{shown}]"
        fix = "the link gives poses in world: name it in [robot] base_frame (mm, quaternion w x y z)"
        yield Finding("base-frame", False, what, fix)
