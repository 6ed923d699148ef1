"""Handlers that read: panel, motion system, RAPID, signals, event log, identity."""

from collections.abc import Mapping
from datetime import timedelta

import numpy as np

from calibration.transforms import Array, quaternion_from_rotation
from mock_robot.cabinet.disk import RAMDISK_PATH
from mock_robot.rws.context import RequestContext
from mock_robot.rws.exchange import Item, Reply
from mock_robot.rws.refusals import (
    BAD_ARGUMENT,
    LIFO_IN_2_0,
    NO_MODULE_2,
    NO_RESOURCE,
    NO_SIGNAL,
    RwsRefused,
)

MIN_UNUSED_AXIS = 8.9e9
UNUSED = {1: "8.999999e+09", 2: "9000000000"}
"""9E9 as RobotWare 6 and 7.20 print it."""
CONFIGURATION = {1: ("j1", "j4", "j6", "jx"), 2: ("cf1", "cf4", "cf6", "cfx")}


def format_float(value: float) -> str:
    """Nine significant digits, which parse to the same float32."""
    return f"{float(np.float32(value)) + 0.0:.9g}"


def format_axis(value: float, unused: str) -> str:
    """Value of an external axis, or `unused` for an axis that does not exist."""
    return unused if value >= MIN_UNUSED_AXIS else format_float(value)


Parts = Mapping[str, str]
MECHUNIT = "ROB_1"
VERSIONS = {1: "6.16.1021", 2: "7.21.0+229"}
AXES = "abcdef"
UNSET = "0.0.0.0"  # noqa: S104  as the controller writes an address that is not set


def controller_state(context: RequestContext, parts: Parts) -> Reply:
    title = _title(context, "ctrlstate", "ctrl-state")
    return Reply(items=[Item("pnl-ctrlstate", title, {"ctrlstate": context.world.controller_state})])


def operating_mode(context: RequestContext, parts: Parts) -> Reply:
    return Reply(items=[Item("pnl-opmode", "opmode", {"opmode": context.world.mode.value})])


def speed_ratio(context: RequestContext, parts: Parts) -> Reply:
    ratio = round(100 * context.world.cabinet.panel.speed_override)
    return Reply(
        items=[Item("pnl-speedratio", _title(context, "speedratio", "speed-ratio"), {"speedratio": str(ratio)})]
    )


def execution(context: RequestContext, parts: Parts) -> Reply:
    values = {"ctrlexecstate": context.world.execution_state, "cycle": context.world.cabinet.panel.cycle}
    return Reply(items=[Item("rap-execution", "execution", values)])


def robtarget(context: RequestContext, parts: Parts) -> Reply:
    pose = _pose(context, parts)
    axes_now = context.world.cabinet.robtarget_axes(context.world.robot_s)
    axes = [format_axis(axis, UNUSED[context.version]) for axis in axes_now]
    spellings = ("eax_", "eax") if context.version == 1 else ("eax_",)
    values = {
        **pose,
        **_configuration(context, ("cf1", "cf4", "cf6", "cfx")),
        **{name + letter: axis for name in spellings for letter, axis in zip(AXES, axes, strict=True)},
    }
    return Reply(items=[Item("ms-robtargets", MECHUNIT, values)])


def cartesian(context: RequestContext, parts: Parts) -> Reply:
    values = {**_pose(context, parts), **_configuration(context, CONFIGURATION[context.version])}
    return Reply(items=[Item("ms-mechunit-cartesian", "cartesian", values)])


def jointtarget(context: RequestContext, parts: Parts) -> Reply:
    _require_mechunit(parts)
    unused = _title(context, UNUSED[context.version], "0")
    axes_now = context.world.cabinet.jointtarget_axes(context.world.robot_s)
    axes = [format_axis(axis, unused) for axis in axes_now]
    values = {
        **{f"rax_{number}": format_float(angle) for number, angle in enumerate(context.world.joints_deg, start=1)},
        **{f"eax_{letter}": axis for letter, axis in zip(AXES, axes, strict=True)},
    }
    return Reply(items=[Item("ms-jointtarget", MECHUNIT, values)])


def mechunits(context: RequestContext, parts: Parts) -> Reply:
    values = {"mode": "Activated", "activation-allowed": "TRUE", "drive-module": "1"}
    return Reply(items=[Item("ms-mechunit-li", MECHUNIT, values)], listed=True)


def motion_system(context: RequestContext, parts: Parts) -> Reply:
    values = {"change-count": "7", "mechunit-name": MECHUNIT, "poll-rate": "60", "absacc-active": "OFF"}
    misc = context.world.equipment.configuration["SYS"]["SYS_MISC"]["ModalPayLoadMode"].attributes["Value"]
    mode = {"modal-payload-mode": "ON" if misc == "1" else "OFF"}
    return Reply(items=[Item("ms", "motionsystem", values | mode)])


def clock(context: RequestContext, parts: Parts) -> Reply:
    at = context.world.elog.epoch + timedelta(seconds=context.now_s)
    return Reply(items=[Item("ctrl-clock-info", "clock", {"datetime": f"{at:%Y-%m-%d T %H:%M:%S}"})])


def mechunit(context: RequestContext, parts: Parts) -> Reply:
    _require_mechunit(parts)
    tool, wobj = context.world.selection
    values = {"tool-name": tool, "wobj-name": wobj, "payload-name": "load0",
              "total-payload-name": "load0", "status": "Synchronized", "mode": "Activated", "jog-mode": "Cartesian",
              "type": "TCPRobot", _title(context, "task", "task-name"): "T_ROB1", "coord-system": "World", "axes": "6",
              "axes-total": "6", "is-integrated-unit": "NoIntegratedUnit",
              "has-integrated-unit": "NoIntegratedUnit"}  # fmt: skip
    return Reply(items=[Item("ms-mechunit", MECHUNIT, values)])


def base_frame(context: RequestContext, parts: Parts) -> Reply:
    _require_mechunit(parts)
    frame = context.world.cabinet.world_T_base
    values = _name_components(frame[:3, 3], quaternion_from_rotation(frame[:3, :3]))
    return Reply(items=[Item("ms-mechunit-baseframe", "baseframe", values)])


def grants(context: RequestContext, parts: Parts) -> Reply:
    """1.0 names a grant in the title, 2.0 in a value."""
    held = context.world.equipment.grants(context.version)
    if context.version == 1:
        return Reply(items=[Item("user-grant", name, {}) for name in held])
    return Reply(items=[Item("uas-grant", str(at), {"grantname": name}) for at, name in enumerate(held)])


def configuration(context: RequestContext, parts: Parts) -> Reply:
    found = context.world.equipment.instances(parts["domain"], parts["type"], context.version)
    return Reply(items=found, listed=True, page=70)


def tasks(context: RequestContext, parts: Parts) -> Reply:
    """RobotWare 7 lists a spy and two pointers before them."""
    memory, run = context.world.memory, context.world.execution_state
    values = {
        name: {
            "name": name,
            "type": "normal" if moves else "semistatic",
            "taskstate": "initiated",
            "excstate": "started" if run == "running" or not moves else "stopped",
            "active": "Off" if name in memory.inactive else "On",
            "motiontask": "TRUE" if moves else "FALSE",
        }
        for name, moves in context.world.tasks.items()
    }
    beside = {"spy": "spy", "program-pointer": "syncstate-pp", "motion-pointer": "syncstate-mp"}
    links = [Item(f"rap-tasks-{kind}-li", title) for title, kind in beside.items()]
    items = [Item("rap-task-li", name, each) for name, each in values.items()]
    return Reply(items=[*(links if context.version == 2 else ()), *items], listed=True)


def modules(context: RequestContext, parts: Parts) -> Reply:
    task = parts.get("task") or context.asked.query.get("task", "")
    loaded = context.world.modules.get(task)
    if loaded is None:
        raise RwsRefused(NO_RESOURCE)
    kind, place = "rap-module-info-li", _title(context, "", f"{task}/")
    return Reply(items=[Item(kind, place + name, {"name": name, "type": sort}) for name, sort in loaded.items()])


def module(context: RequestContext, parts: Parts) -> Reply:
    loaded = context.world.modules.get(parts["task"], {})
    found = next((name for name in loaded if name.lower() == parts["module"].lower()), None)
    if found is None:
        raise RwsRefused(NO_RESOURCE if context.version == 1 else NO_MODULE_2)
    return Reply(items=[Item("rap-module", found, {"modname": found, "attributes": loaded[found]})])


def symbol_value(context: RequestContext, parts: Parts) -> Reply:
    name, symbol = context.require_symbol(parts["symbol"])
    return Reply(items=[Item("rap-data", f"RAPID/{name}", {"value": symbol.value})])


def symbol_properties(context: RequestContext, parts: Parts) -> Reply:
    name, symbol = context.require_symbol(parts["symbol"])
    values = {"symburl": f"RAPID/{name}", "symtyp": "per", "named": "true", "dattyp": symbol.type, "ndim": "0",
              "dim": "", "local": "false", "rdonly": "false", "taskpers": "false",
              "typurl": f"RAPID/{symbol.type}"}  # fmt: skip
    return Reply(items=[Item("rap-symproppers", f"RAPID/{name}", values)])


def signals(context: RequestContext, parts: Parts) -> Reply:
    items = [_signal_item(context, name, "ios-signal-li") for name in context.world.signals]
    return Reply(items=items, listed=True, page=100)


def signal(context: RequestContext, parts: Parts) -> Reply:
    found = context.world.signal(parts["signal"])
    if found is None:
        raise RwsRefused(NO_SIGNAL)
    return Reply(items=[_signal_item(context, found[0], "ios-signal")])


def event_log(context: RequestContext, parts: Parts) -> Reply:
    """2.0 lists the oldest entries first; the newest ones first only to who accepts version 2.1."""
    lifo = context.asked.query.get("order") == "lifo"
    if context.version == 1:
        return Reply(items=context.world.elog.items(), listed=True)
    if lifo and "v=2.1" not in context.asked.headers.get("accept", ""):
        raise RwsRefused(LIFO_IN_2_0)
    return Reply(items=context.world.elog.items(oldest_first=not lifo, version=2), listed=True)


def masterships(context: RequestContext, parts: Parts) -> Reply:
    """What a mastership can be asked for: RobotWare 7 has `edit` for configuration and RAPID."""
    names = _title(context, "cfg motion rapid", "edit motion").split()
    return Reply(items=[Item("msh-resource-li", name) for name in names], listed=True)


def system(context: RequestContext, parts: Parts) -> Reply:
    version = VERSIONS[context.version]
    major, minor, build = version.partition("+")[0].split(".")
    values = {"name": "handeyed mock", "rwversion": version, "rwversionname": version,
              "sysid": "{00000000-0000-0000-0000-000000000001}",
              "starttm": f"{context.world.elog.epoch:%Y-%m-%d T %H:%M:%S}"}  # fmt: skip
    if context.version == 1:
        return Reply(items=[Item("sys-system-li", "system", values)])
    more = {"major": major, "minor": minor, "build": build, "title": "RobotWare", "revision": "0", "sub-revision": "0",
            "buildtag": "", "robapi-compatibility-revision": "5", "type": "RobotWare",
            "description": "Controller Software", "date": "2025-11-05", "mctimestamp": "",
            "rwdistributionversion": version}  # fmt: skip
    return Reply(items=[Item("sys-system", "system", values | more)])


def options(context: RequestContext, parts: Parts) -> Reply:
    names = context.world.equipment.options(context.version)
    return Reply(items=[Item("sys-option-li", str(at), {"option": name}) for at, name in enumerate(names)], listed=True)


def identity(context: RequestContext, parts: Parts) -> Reply:
    kind = "Virtual Controller" if context.world.equipment.virtual else _title(context, "Real Controller", "c30")
    more = {"ctrl-level": "System Level"} if context.version == 1 else {"ctrl-mac": "00:00:00:00:00:00"}
    values = {"ctrl-name": "handeyed mock", "ctrl-id": "1600-000001", "ctrl-type": kind, **more}
    return Reply(items=[Item("ctrl-identity-info", "identity", values)])


def network(context: RequestContext, parts: Parts) -> Reply:
    """The networks of the GoFa that have an address, and the mock's own as the public one."""
    rows = (
        ("X6", "LAN1", "Private", "192.168.125.1"),
        ("X23", "WAN", "Public", context.world.address),
        ("X2", "LAN3", "I/O", "192.168.1.211"),
    )
    keys = ("logical-name", "network", "addr", "mask", "dhcp", "dns-primary", "dns-secondary", "gateway")
    rest = ("255.255.255.0", "disabled", UNSET, UNSET, UNSET)
    return Reply(items=[Item("ctrl-netw", row[0], dict(zip(keys, row[1:] + rest, strict=True))) for row in rows])


def progress(context: RequestContext, parts: Parts) -> Reply:
    """A backup is pending when it is looked at first."""
    found = context.world.backups.get(parts["number"])
    if found is None:
        raise RwsRefused(NO_RESOURCE)
    context.world.backups[parts["number"]] = "ready"
    return Reply(items=[Item("progress", parts["number"], {"state": found, "code": "294912"})])


def ramdisk(context: RequestContext, parts: Parts) -> Reply:
    return Reply(items=[Item("ctrl-env", "$RAMDISK", {"_value": RAMDISK_PATH, "value": RAMDISK_PATH})])


# --- helpers ---


def _title(context: RequestContext, first: str, second: str) -> str:
    return first if context.version == 1 else second


def _require_mechunit(parts: Parts) -> None:
    if parts["mechunit"].upper() != MECHUNIT:
        raise RwsRefused(NO_RESOURCE)


def _pose(context: RequestContext, parts: Parts) -> dict[str, str]:
    """Position and quaternion by name. Tool and work object default to those selected at the pendant."""
    _require_mechunit(parts)
    query, (tool, wobj) = context.asked.query, context.world.selection
    try:
        position, quaternion = context.world.pose(
            query.get("tool", tool), query.get("wobj", wobj), query.get("coordinate", "Wobj")
        )
    except KeyError as unknown:
        raise RwsRefused(BAD_ARGUMENT, f"Unknown tool, work object or coordinate system {unknown}") from None
    return _name_components(position, quaternion)


def _name_components(position: Array, quaternion: Array) -> dict[str, str]:
    return dict(zip(("x", "y", "z", "q1", "q2", "q3", "q4"), map(format_float, [*position, *quaternion]), strict=True))


def _configuration(context: RequestContext, names: tuple[str, str, str, str]) -> dict[str, str]:
    return {name: str(quarter) for name, quarter in zip(names, context.world.configuration, strict=True)}


def _signal_item(context: RequestContext, name: str, kind: str) -> Item:
    held = context.world.signals[name]
    title = f"{held.place}/{name}" if held.place else name
    lvalue = held.lvalue(context.world.cabinet)
    return Item(
        kind, title, {"name": name, "type": held.type, "category": "", "lvalue": lvalue, "lstate": "not simulated"}
    )
