"""What a controller is and has, read over Robot Web Services before anything is changed."""

import asyncio
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from drivers.robots.abb.rws.controller_reader import ConfigurationInstance, ControllerReader
from protocols.cfg_file import CfgFile

IDENTITY = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
FIREWALL, MISCELLANEOUS = "SIO/FIREWALL_MANAGEMENT", "SYS/SYS_MISC"
"""Types of the configuration that are read whatever is installed."""


@dataclass(frozen=True)
class Network:
    """A network of the controller. `kind`: "Public", "Private", "I/O", ... as the firewall has them."""

    connector: str
    kind: str
    address: str

    def __str__(self) -> str:
        return f"{self.address} ({self.connector}, {self.kind})"


@dataclass(frozen=True)
class ControllerSurvey:
    """State before an installation. None: the controller does not say.

    `mastership`: "nomaster", "remote" or "local". `instances`: of the configuration by "DOMAIN/TYPE".
    `modules`: by task. `files`: content of those files to be written that exist already. `symbols`: values of the
    settings in use, by task/module/name; {} while the modules are not loaded.
    """

    name: str
    robotware: str
    services: int
    virtual: bool
    mode: str
    controller: str
    execution: str
    options: tuple[str, ...] | None
    grants: tuple[str, ...] | None
    tasks: Mapping[str, bool]
    units: tuple[str, ...]
    base_frame: tuple[float, ...] | None
    networks: tuple[Network, ...]
    reached: Network | None
    mastership: str | None
    instances: Mapping[str, tuple[ConfigurationInstance, ...]]
    modules: Mapping[str, tuple[str, ...]]
    files: Mapping[str, bytes]
    symbols: Mapping[str, str]

    @property
    def family(self) -> int:
        """RobotWare 6, 7 or 8, whose fragments are loaded."""
        first = self.robotware.partition(".")[0]
        return int(first) if first.isdecimal() else {1: 6, 2: 7}[self.services]

    @property
    def motion_tasks(self) -> tuple[str, ...]:
        return tuple(name for name, moves in self.tasks.items() if moves)

    @property
    def lost_by_reset(self) -> tuple[str, ...]:
        """Loaded modules, as task/module, that no entry of the configuration loads: Reset RAPID deletes them."""
        entries = self.instances.get("SYS/CAB_TASK_MODULES", ())
        stays = {each.attributes.get("ModName", "").casefold() for each in entries} | {"base", "user"}
        stays |= {re.split(r"[:/.]", each.attributes.get("File", "").casefold())[-2:][0] for each in entries}
        return tuple(
            f"{task}/{name}" for task, names in self.modules.items() for name in names if name.casefold() not in stays
        )

    def summary(self) -> tuple[str, ...]:
        """Lines for a person."""
        frame = "unknown" if self.base_frame is None else "at world" if self.base_at_world else "not at world"
        kind = "virtual controller" if self.virtual else "controller"
        return (
            f"{kind} {self.name}, RobotWare {self.robotware}, {self.controller}, {self.mode}, RAPID {self.execution}",
            f"tasks {', '.join(self.tasks) or 'none'}; units {', '.join(self.units) or 'none'}; base frame {frame}",
        )

    @property
    def base_at_world(self) -> bool:
        """Whether base and world frame agree, within 0.01 mm and 0.01°; TRUE when the frame is unknown."""
        pairs = zip(self.base_frame or IDENTITY, IDENTITY, (0.01,) * 3 + (1e-4,) * 4, strict=True)
        return all(abs(abs(value) - wanted) <= slack for value, wanted, slack in pairs)


async def read_networks(controller: ControllerReader) -> tuple[tuple[Network, ...], Network | None]:
    """Networks of the controller, and the one where it was reached, None when it is none. Raises DeviceError."""
    listed = tuple(
        Network(*(str(each.get(key, "")) for key in ("_title", "network", "addr")))
        for each in await controller.read("/ctrl/network") or ()
        if str(each.get("addr", "")).strip("0.")
    )
    own = {str(at[0]) for *_, at in await asyncio.get_running_loop().getaddrinfo(controller.address.host, None)}
    return listed, next((each for each in listed if each.address in own), None)


async def read_survey(
    controller: ControllerReader, fragments: Iterable[CfgFile], files: Iterable[str], symbols: Iterable[str], task: str
) -> ControllerSurvey:
    """Read all that an installation depends on; changes nothing.

    `files`: paths below HOME that would be written; `symbols`: names of settings, as module/name, in `task`. Raises
    DeviceError.
    """
    system, identity = await controller.read_first("/rw/system"), await controller.read_first("/ctrl/identity")
    networks, reached = await read_networks(controller)
    panel, mastership = await controller.read_panel(), await controller.read_mastership()
    units = tuple(str(each.get("_title", "")) for each in await controller.read("/rw/motionsystem/mechunits") or ())
    tasks = {
        str(each.get("name") or each.get("_title", "")): str(each.get("motiontask", "")).upper() == "TRUE"
        for each in await controller.read("/rw/rapid/tasks") or ()
        if "taskstate" in each  # RobotWare 7 lists spy and pointers beside the tasks
    }
    kinds = {f"{fragment.domain}/{each.kind}" for fragment in fragments for each in fragment.instances}
    kinds |= {MISCELLANEOUS, FIREWALL} if controller.version == 2 else {MISCELLANEOUS}
    found = {path: await controller.read_file(path) for path in files}
    in_use = {name: await controller.read_symbol(f"{task}/{name}") for name in symbols}
    return ControllerSurvey(
        name=str(identity.get("ctrl-name") or system.get("name", "")),
        robotware=str(system.get("rwversion", "")),
        services=controller.version,
        virtual="virtual" in str(identity.get("ctrl-type", "")).lower(),
        mode=str(panel.get("opmode", "")),
        controller=str(panel.get("ctrlstate", "")),
        execution=str(panel.get("ctrlexecstate", "")),
        options=await controller.read_options(),
        grants=await controller.read_grants(),
        tasks=tasks,
        units=units,
        networks=networks,
        reached=reached,
        base_frame=await controller.read_base_frame(controller.address.mechunit),
        mastership=str(mastership["mastership"]) if "mastership" in mastership else None,
        instances={kind: await controller.read_instances(*kind.split("/")) for kind in sorted(kinds)},
        modules={each: await controller.read_modules(each) for each in tasks},
        files={path: content for path, content in found.items() if content is not None},
        symbols={f"{task}/{name}": value for name, value in in_use.items() if value is not None},
    )
