"""The steps of an installation, from what the controller is and what is to be installed. Pure."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from drivers.robots.abb.rapid_names import RapidNames
from drivers.robots.abb.rws.controller_reader import ConfigurationInstance
from drivers.robots.abb.rws.rapid_data import same_value
from drivers.robots.abb.setup import settings
from drivers.robots.abb.setup.requirements import FIREWALL_MENU, WRITE_CONFIGURATION, WRITE_DATA, Finding
from drivers.robots.abb.setup.survey import FIREWALL, ControllerSurvey
from protocols.cfg_file import CfgFile, CfgInstance, parse_cfg

LOAD_MENU = "RobotStudio: Configuration, Load Parameters, 'Load parameters if no duplicates'"
RESET_MENU = {
    6: "pendant: ABB menu, Restart, Advanced, Reset RAPID",
    7: "pendant: Settings, Advanced restart, Reset RAPID",
}
RESET_RAPID = (
    "restart with Reset RAPID ({menu}). IT DELETES ALL PROGRAMS AND DATA FROM MEMORY and loads what the configuration "
    "names. Nothing tells which modules have unsaved changes (positions modified): save first what is to stay{lost}"
)
POINTER = "run mode continuous; PP to main; motors on; start; then AUTO"
CALLED = "{task}: write cell_motion; into your program where the arm may leave its work; " + POINTER
EGM = "EGM: load CELL_egm.mod into the motion task, and call cell_motion_egm, or in CELL_main cell_obey_egm TRUE"
FIREWALL_UNREAD = f"let the link through: {FIREWALL_MENU}: RapidSockets, for the network that the PC is at"


@dataclass(frozen=True)
class Package:
    """What is installed: files by name in one folder of HOME, among them the configuration fragments.

    `names`: those of the arm that the program is for.
    """

    folder: str
    files: Mapping[str, bytes]
    names: RapidNames = field(default_factory=RapidNames)

    @classmethod
    def from_files(cls, folder: str, files: Mapping[str, bytes], names: RapidNames) -> "Package":
        """The shipped files for an arm of those names, in that folder."""
        renamed = names.rename_all({name: content.decode("ascii") for name, content in files.items()})
        there = {name: text.replace("HOME:/handeyed/", f"HOME:/{folder}/") for name, text in renamed.items()}
        return cls(folder, {name: text.encode("ascii") for name, text in there.items()}, names)

    @property
    def fragments(self) -> dict[str, CfgFile]:
        """Configuration files by name."""
        return {
            name: parse_cfg(content.decode("ascii", "replace"))
            for name, content in self.files.items()
            if name.lower().endswith(".cfg")
        }

    @property
    def shared(self) -> str:
        """Text of the module with the settings; "" without one."""
        return self.files.get(self._shared_name, b"").decode("ascii", "replace")

    @property
    def _shared_name(self) -> str:
        return self.names.rename("CELL_shared.sys")

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths below HOME."""
        return tuple(f"{self.folder}/{name}" for name in self.files)

    def with_settings(self, values: Mapping[str, str]) -> "Package":
        """The same with other settings. Raises AddressNotUnderstood for one that cannot be."""
        if not values:
            return self
        written = settings.replace_settings(self.shared, values).encode("ascii")
        return replace(self, files={**self.files, self._shared_name: written})

    def setting(self, name: str) -> str:
        """Value of a setting, named as shipped, in the text; "" without one."""
        return settings.value_in(self.shared, self.names.rename(name)) or ""

    @property
    def is_called(self) -> bool:
        """Whether a program of the customer calls the motion part, which then has no main of its own."""
        return self.names.rename("CELL_main.mod") not in self.files

    @property
    def load_is_default(self) -> bool:
        """Whether the tool load is the 1 gram of tool0."""
        return "[0.001," in self.setting("cell_flange").replace(" ", "")


@dataclass(frozen=True)
class SetupPlan:
    """What would be done. `symbols`: values by task/module/name. `by_hand`: steps of a person, in order."""

    package: Package
    replaced: tuple[str, ...]
    unchanged: tuple[str, ...]
    load: tuple[str, ...]
    symbols: Mapping[str, str]
    by_hand: tuple[str, ...]

    @property
    def writes(self) -> tuple[str, ...]:
        return tuple(name for name in self.package.files if name not in self.unchanged)

    @property
    def changes_anything(self) -> bool:
        """Whether anything is to be done over Robot Web Services."""
        return bool(self.writes or self.load or self.symbols)

    @property
    def needs_backup(self) -> bool:
        """Whether a full backup is made first: something is loaded now, or with the next restart."""
        return bool(self.writes or self.load)

    def lines(self) -> tuple[str, ...]:
        """Lines for a person, in the order of execution."""
        folder = self.package.folder
        kept = "back up  configuration of " + ", ".join(sorted({f.domain for f in self.package.fragments.values()}))
        return (
            *(("back up  the whole controller, on its disk",) if self.needs_backup else ()),
            *((kept,) if self.load else ()),
            *(f"back up  HOME:/{folder}/{name}" for name in self.replaced),
            *(f"write    HOME:/{folder}/{name}  {len(self.package.files[name])} bytes" for name in self.writes),
            *(f"load     {name}" for name in self.load),
            *(f"set      {name} := {value}" for name, value in self.symbols.items()),
            *(f"by hand  {number}. {step}" for number, step in enumerate(self.by_hand, 1)),
        )


def plan_setup(
    survey: ControllerSurvey, package: Package, values: Mapping[str, str], found: Iterable[Finding], task: str
) -> SetupPlan:
    """Plan an installation of `package` with the settings `values`. Raises AddressNotUnderstood for a bad setting."""
    package = package.with_settings(values)
    found = tuple(found)
    codes = {finding.code for finding in found}
    locked = bool({"manual-mode", "mastership"} & codes)
    current = {path.rpartition("/")[2]: content for path, content in survey.files.items()}
    unchanged = tuple(name for name, content in package.files.items() if current.get(name) == content)
    absent = tuple(name for name, fragment in package.fragments.items() if wants(survey, fragment, package))
    may_load = WRITE_CONFIGURATION.is_held(survey) and not locked and survey.family <= 7
    symbols = {} if locked or not WRITE_DATA.is_held(survey) else _symbols(survey, package, values)
    changed = set(package.files) - set(unchanged) or absent
    by_hand = (
        *(() if may_load else (f"{LOAD_MENU}: HOME:/{package.folder}/{name}" for name in absent)),
        *((reset_step(survey.family, survey.lost_by_reset),) if changed else ()),
        *(finding.fix for finding in found if finding.code == "firewall"),
        *((FIREWALL_UNREAD,) if survey.family >= 7 and not (survey.virtual or survey.instances.get(FIREWALL)) else ()),
        *((EGM,) if package.names.rename("CELL_egm.mod") in package.files else ()),
        (CALLED if package.is_called else "{task}: no other module may have a main; " + POINTER).format(task=task),
        "run this command again: it reads back the settings in use" if not survey.symbols else "handeyed check",
    )
    replaced = tuple(name for name in package.files if name in current and name not in unchanged)
    return SetupPlan(package, replaced, unchanged, absent if may_load else (), symbols, by_hand)


def reset_step(family: int, lost: Iterable[str] = ()) -> str:
    """What a person is asked to do, and what it takes. `lost`: modules that it deletes for good."""
    named = ", ".join(lost)
    return RESET_RAPID.format(
        menu=RESET_MENU.get(family, RESET_MENU[7]), lost=f": no configuration loads {named}" if named else ""
    )


ANOTHER = "it is of another set-up: handeyed robot remove, with the backup of that one, then this command again"


def configuration_findings(survey: ControllerSurvey, package: Package) -> tuple[Finding, ...]:
    """Instances of the controller that are not the package's: of the same name, or left of another set-up."""
    found, folder = [], f"HOME:/{package.folder}/".casefold()
    wanted = {(f"{f.domain}/{each.kind}", each.name): each for f in package.fragments.values() for each in f.instances}
    for kind, instances in survey.instances.items():
        for each in instances:
            ours = wanted.get((kind, each.name))
            file = each.attributes.get("File", "")
            if ours is not None and not each.agrees_with(ours):
                shown = ", ".join(
                    f"{name} {value}" for name, value in each.attributes.items() if name in ours.attributes
                )
                what = f"the controller has another {each.name} in {kind}: {shown}"
                fix = f"name ours differently (--link-task, --prefix), or {ANOTHER}"
                found.append(Finding("not-ours", True, what, fix))
            elif ours is None and file.casefold().startswith(folder):
                what = f"{kind} still names {file}, which this program has not"
                found.append(Finding("left-over", True, what, ANOTHER))
    for name, fragment in package.fragments.items():
        named = _instances_of(survey, fragment, package)
        absent = [each.name for each in named if not _is_there(survey, fragment, each)]
        if absent and len(absent) < len(named):
            what = f"the controller has {name} in part: {', '.join(absent)} is not there"
            found.append(Finding("in-part", True, what, ANOTHER))
    return tuple(found)


def wants(survey: ControllerSurvey, fragment: CfgFile, package: Package) -> bool:
    """Whether a fragment is still to be loaded: one of its instances, as far as they are listed, is not there.

    The serial port is wanted only for a link over a serial line.
    """
    return any(not _is_there(survey, fragment, each) for each in _instances_of(survey, fragment, package))


def _instances_of(survey: ControllerSurvey, fragment: CfgFile, package: Package) -> list[CfgInstance]:
    """Wanted instances that can be recognised in the controller's lists."""
    serial = package.setting("cell_use_serial").upper() == "TRUE"
    return [
        each
        for each in fragment.instances
        if each.kind != "SYSSIG_OUT"
        and (serial or each.kind != "COM_PHY_CHANNEL")
        and ("Name" in each.attributes or all(one.attributes for one in _instances(survey, fragment, each)))
    ]


def _is_there(survey: ControllerSurvey, fragment: CfgFile, wanted: CfgInstance) -> bool:
    return wanted.name in {one.name for one in _instances(survey, fragment, wanted)}


def _instances(survey: ControllerSurvey, fragment: CfgFile, wanted: CfgInstance) -> tuple[ConfigurationInstance, ...]:
    return survey.instances.get(f"{fragment.domain}/{wanted.kind}", ())


def _symbols(survey: ControllerSurvey, package: Package, values: Mapping[str, str]) -> dict[str, str]:
    """Settings in use that differ from those wanted."""
    wanted = {name: package.setting(name) for name in values}
    return {
        symbol: wanted[name]
        for symbol, value in survey.symbols.items()
        if (name := symbol.rpartition("/")[2]) in wanted and not same_value(value, wanted[name])
    }
