"""What a controller is and has, read over Robot Web Services before anything is changed."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from drivers.robots.abb.rws.administration import ConfigurationInstance, RwsAdministration
from protocols.cfg_file import CfgFile

IDENTITY = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ControllerSurvey:
    """State before an installation. None: the controller does not say.

    `mastership`: "nomaster", "remote" or "local". `instances`: of the configuration by "DOMAIN/TYPE".
    `files`: content of those files to be written that exist already. `symbols`: values of the settings in use, by
    task/module/name; {} while the modules are not loaded.
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
    mastership: str | None
    instances: Mapping[str, tuple[ConfigurationInstance, ...]]
    modules: tuple[str, ...]
    files: Mapping[str, bytes]
    symbols: Mapping[str, str]

    @property
    def family(self) -> int:
        """RobotWare 6, 7 or 8, whose fragments are loaded."""
        first = self.robotware.partition(".")[0]
        return int(first) if first.isdecimal() else {1: 6, 2: 7}[self.services]

    @property
    def motion_tasks(self) -> tuple[str, ...]:
        """Tasks that move an arm."""
        return tuple(name for name, moves in self.tasks.items() if moves)

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


async def read_survey(
    controller: RwsAdministration, fragments: Iterable[CfgFile], files: Iterable[str], symbols: Iterable[str], task: str
) -> ControllerSurvey:
    """Read all that an installation depends on; changes nothing.

    `files`: paths below HOME that would be written; `symbols`: names of settings, as module/name, in `task`. Raises
    DeviceError.
    """
    system, identity = await controller.read_first("/rw/system"), await controller.read_first("/ctrl/identity")
    panel, mastership = await controller.read_panel(), await controller.read_mastership()
    units = tuple(str(each.get("_title", "")) for each in await controller.read("/rw/motionsystem/mechunits") or ())
    tasks = {
        str(each.get("name") or each.get("_title", "")): str(each.get("motiontask", "")).upper() == "TRUE"
        for each in await controller.read("/rw/rapid/tasks") or ()
    }
    kinds = {f"{fragment.domain}/{each.kind}" for fragment in fragments for each in fragment.instances}
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
        base_frame=await controller.read_base_frame(controller.address.mechunit),
        mastership=str(mastership["mastership"]) if "mastership" in mastership else None,
        instances={kind: await controller.read_instances(*kind.split("/")) for kind in sorted(kinds)},
        modules=await controller.read_modules(task),
        files={path: content for path, content in found.items() if content is not None},
        symbols={f"{task}/{name}": value for name, value in in_use.items() if value is not None},
    )
