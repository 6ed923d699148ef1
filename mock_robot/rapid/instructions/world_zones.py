"""World zones: volumes that switch an output, or that stop the arm. Zones of joints are not here."""

from types import MappingProxyType

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.signals import signal_of
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import Type
from mock_robot.rapid.zones import WZSTATIONARY, WZTEMPORARY, Zone, box, cylinder, sphere


def box_def(
    task: ProgramTask, inside: bool | None, outside: bool | None, shape: Slot, low: list[float], high: list[float]
) -> None:
    shape.value.set(box(low, high), bool(outside))


def sphere_def(
    task: ProgramTask, inside: bool | None, outside: bool | None, shape: Slot, centre: list[float], radius: float
) -> None:
    shape.value.set(sphere(centre, radius), bool(outside))


def cylinder_def(
    task: ProgramTask,
    inside: bool | None,
    outside: bool | None,
    shape: Slot,
    centre: list[float],
    radius: float,
    height: float,
) -> None:
    shape.value.set(cylinder(centre, radius, height), bool(outside))


def supervise(
    task: ProgramTask, temporary: bool | None, stationary: bool | None, zone: tuple[Type, Slot], shape: Slot
) -> None:
    """The program stops before the tool moves on within the volume."""
    forbidden, contains = task.services.unit.forbidden, shape.value.contains
    made = _made(zone, stationary)
    made.begin = lambda: forbidden.__setitem__(id(made), contains)
    made.end = lambda: forbidden.pop(id(made), None)
    made.begin()


def set_output(
    task: ProgramTask,
    temporary: bool | None,
    stationary: bool | None,
    zone: tuple[Type, Slot],
    inside: bool | None,
    before: bool | None,
    shape: Slot,
    output: Slot,
    value: float,
) -> None:
    """The output has the value within the volume, the inverse elsewhere; \\Before is taken as \\Inside."""
    unit, contains, signal = task.services.unit, shape.value.contains, signal_of(output.value)
    made = _made(zone, stationary)

    def begin() -> None:
        signal.source = lambda: contains(unit.tool_mm()) is bool(value)

    def end() -> None:
        signal.source = None

    made.begin, made.end = begin, end
    begin()


def _made(zone: tuple[Type, Slot], stationary: bool | None) -> Zone:
    if zone[0] not in (WZSTATIONARY, WZTEMPORARY) or (zone[0] == WZSTATIONARY) is not bool(stationary):
        raise RapidError("ERR_ARGVALERR", "\\Stat goes with a wzstationary, \\Temp with a wztemporary")
    made: Zone = zone[1].value
    return made


def enable(task: ProgramTask, zone: Slot) -> None:
    zone.value.begin()


def disable(task: ProgramTask, zone: Slot) -> None:
    zone.value.end()


DOES = MappingProxyType(
    {
        "WZBoxDef": box_def,
        "WZSphDef": sphere_def,
        "WZCylDef": cylinder_def,
        "WZLimSup": supervise,
        "WZDOSet": set_output,
        "WZEnable": enable,
        "WZDisable": disable,
        "WZFree": disable,
    }
)
