"""Rows of the link and the services, which nobody has to touch the controller for. Each returns what it measured."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator

import numpy as np

from calibration.transforms import difference
from drivers.errors import DeviceError
from drivers.robots.abb.acceptance.bench import Bench, RowFailed, RowSkipped, goal_of
from drivers.robots.abb.acceptance.person import EVENT, PENDANT
from drivers.robots.abb.acceptance.subscription import subscribe
from drivers.robots.abb.acceptance.wire import Wire
from drivers.robots.abb.cb_session import WireCounts
from drivers.robots.abb.egm_vibration import EgmMonitor
from drivers.robots.abb.robtarget import UNUSED_AXES
from drivers.robots.abb.setup.requirements import findings
from drivers.robots.abb.setup.survey import read_survey
from protocols.cb.client import UnexpectedReply
from protocols.cb.codes import Flag, MoveKind
from protocols.cb.messages import GetJoints, GetPose, GetStatus, Move, Ping, Request

Measured = dict[str, float | str]
QUARTER_DEG = 90.0
EVENT_LIMIT_S = 5.0
BORDER_DEG = 0.05
MAX_FRAME_MM, MAX_FRAME_RAD = 1e-2, 1e-4
EGM_SHARE_LOST, EGM_VIBRATION_MM = 0.02, 0.05


async def see_ready(bench: Bench) -> Measured:
    """Motors on, AUTO, no emergency stop, program running."""
    async with bench.wire() as wire:
        flags = (await bench.report(wire)).flags
    lacking = [flag.name or "" for flag in (Flag.MOTORS_ON, Flag.AUTO, Flag.TASK_RUNNING) if not flags & flag]
    if flags & Flag.ESTOP:
        lacking.append("no ESTOP")
    if lacking:
        raise RowFailed(f"not ready: {', '.join(lacking)}")
    return {"speed limited": str(bool(flags & Flag.SPEED_LIMITED))}


async def see_equipment(bench: Bench) -> Measured:
    """Options, grants and RobotWare are those that the program needs."""
    async with bench.administration() as controller:
        survey = await read_survey(controller, (), (), (), "T_ROB1")
        unit = controller.address.mechunit
    task = survey.motion_tasks[0] if survey.motion_tasks else "T_ROB1"
    found = findings(
        survey, task=task, unit=unit, serial=False, egm=bench.limits.egm_port is not None, load_is_default=False
    )
    lacking = [each for each in found if each.missing or each.code in ("options", "grant-data", "grant-remote-stop")]
    if lacking:
        raise RowFailed("; ".join(each.what for each in lacking))
    return {"RobotWare": survey.robotware, "notes": "; ".join(each.what for each in found)}


async def see_services(bench: Bench) -> Measured:
    """Twenty reads of the panel over Robot Web Services answer, each within the limit."""
    slowest_s, clock = 0.0, bench.timing.clock
    async with bench.administration() as controller:
        for _ in range(20):
            await bench.timing.sleep(0.1)  # so that our own limit of requests a second delays none
            began_s = clock()
            if not await controller.read_first("/rw/panel/opmode"):
                raise RowFailed("the operating mode cannot be read")
            slowest_s = max(slowest_s, clock() - began_s)
            if slowest_s > bench.limits.service_s:
                raise RowFailed(f"an answer took {slowest_s:.2f} s")
    return {"slowest ms": round(1000 * slowest_s, 1)}


async def see_mastership(bench: Bench) -> Measured:
    """Nobody holds the mastership that loading and settings need."""
    async with bench.administration() as controller:
        state = str((await controller.read_mastership()).get("mastership", "not there"))
    if state != "nomaster":
        raise RowFailed(f"the mastership is {state}: release it, or install by hand")
    return {}


async def see_selection(bench: Bench) -> Measured:
    """The pendant shows poses of tool0 in wobj0, so that a person can compare them."""
    async with bench.administration() as controller:
        values = await controller.read_first(f"/rw/motionsystem/mechunits/{controller.address.mechunit}")
    shown = (values.get("tool-name"), values.get("wobj-name"))
    if shown != ("tool0", "wobj0"):
        raise RowFailed(f"{shown[0]} in {shown[1]} is selected at the pendant: select tool0 and wobj0")
    return {}


async def see_events(bench: Bench) -> Measured:
    """A switch at the controller reaches the subscription."""
    async with bench.administration() as controller, subscribe(controller.client) as events:
        arrival = asyncio.create_task(_number_of_event(events))
        try:
            await bench.ask_person(EVENT)
            if await bench.timing.wait_until_done(arrival, EVENT_LIMIT_S) and (number := arrival.result()):
                return {"event": number}
        finally:
            arrival.cancel()
            await asyncio.gather(arrival, return_exceptions=True)
    raise RowFailed("the subscription is open, and brings no event")


async def _number_of_event(events: AsyncIterator[dict[str, str]]) -> float | None:
    """Number of the next entry of the event log; None when the subscription ends before."""
    async for event in events:
        if event.get("seqnum", "").isdecimal():
            return float(event["seqnum"])
    return None


async def see_clean_line(bench: Bench) -> Measured:
    """Nothing is repeated, nothing unasked comes, and each answer arrives in one piece."""
    async with bench.wire() as wire:
        for at in range(bench.limits.samples):
            await wire.ask((Ping(), GetStatus(), GetPose(), GetJoints())[at % 4])
        counts = wire.counts
    _check_undisturbed(counts, bench.limits.repeats)
    if counts.pieces > 1.2 * counts.answers and not bench.transport.resynchronise:
        raise RowFailed(f"{counts.answers} answers came in {counts.pieces} pieces")
    return {"answers": float(counts.answers), "pieces": float(counts.pieces)}


def _check_undisturbed(counts: WireCounts, repeats: int) -> None:
    """Raises RowFailed for more repetitions than accepted, and for what came unasked but their second answers."""
    strange = counts.strange - Counter({UnexpectedReply.__name__: min(counts.repeats, repeats)})
    if strange or counts.repeats > repeats:
        unasked = ", ".join(f"{count} {name}" for name, count in strange.items())
        raise RowFailed(f"{counts.repeats} requests had to be repeated; unasked: {unasked or 'nothing'}")


async def time_commands(bench: Bench) -> Measured:
    """Each command is answered within the limit; the checksum's time per byte from the longest request."""
    far = Move((0.0, 0.0, 1e4), (1.0, 0.0, 0.0, 0.0), (0, 0, 0, 0), UNUSED_AXES, 10.0, MoveKind.JOINT)
    requests: dict[str, Request] = {"PING": Ping(), "GET_POSE": GetPose(), "GET_JOINTS": GetJoints(),
                                    "GET_STATUS": GetStatus(), "MOVE refused": far}  # fmt: skip
    measured: Measured = {}
    medians = {}
    async with bench.wire() as wire:
        for name, request in requests.items():
            times = [(await wire.ask(request)).seconds for _ in range(max(5, bench.limits.samples // 5))]
            medians[name] = float(np.median(times))
            measured[f"{name} ms"] = round(1000 * medians[name], 2)
            measured[f"{name} worst ms"] = round(1000 * max(times), 2)
            if max(times) > bench.limits.reply_s:
                raise RowFailed(f"{name} took {max(times):.3f} s; a request is repeated after 0.25 s")
    bytes_more = 68
    measured["checksum us a byte"] = round(1e6 * max(0.0, medians["MOVE refused"] - medians["PING"]) / bytes_more, 1)
    return measured


async def see_pose(bench: Bench) -> Measured:
    """A pose is finite, in millimetres, with a unit quaternion, and the same twice while the arm stands."""
    async with bench.wire() as wire:
        raw = (await wire.ask(GetPose())).reply
        one, other = await bench.pose(wire), await bench.pose(wire)
    norm = float(np.linalg.norm(getattr(raw, "quaternion_wxyz", (0.0,))))
    if abs(norm - 1.0) > 1e-4:
        raise RowFailed(f"the quaternion's length is {norm:.5f}")
    reach = float(np.linalg.norm(one.base_T_flange[:3, 3]))
    if not 20.0 < reach < 1e4:
        raise RowFailed(f"the flange is {reach:g} from the origin: that is not in mm")
    if not bench.same(one, other):
        raise RowFailed("two poses of a standing arm differ")
    return {"distance mm": round(reach, 2)}


async def see_frames(bench: Bench) -> Measured:
    """The pose over the link is that of Robot Web Services, and of the pendant."""
    async with bench.wire() as wire, bench.robot_services() as robot:
        here, there = await bench.pose(wire), await robot.read_pose()
    off_mm, off_rad = difference(here.base_T_flange, there.base_T_flange)
    if off_mm > MAX_FRAME_MM or off_rad > MAX_FRAME_RAD:
        raise RowFailed(f"the link and Robot Web Services differ by {off_mm:.3f} mm and {np.degrees(off_rad):.4f}°")
    shown = ", ".join(f"{value:.2f}" for value in here.base_T_flange[:3, 3])
    await bench.ask_person(PENDANT, pose=f"[{shown}]")
    return {"difference mm": round(off_mm, 5), "difference deg": round(float(np.degrees(off_rad)), 6)}


async def see_posture(bench: Bench) -> Measured:
    """cf1, cf4 and cf6 are the quarter turns of axes 1, 4 and 6; cfx is that of Robot Web Services, where asked."""
    async with bench.wire() as wire:
        pose, joints = await bench.pose(wire), await bench.joints_deg(wire)
    for number, axis in enumerate((0, 3, 5)):
        quarters = {int(np.floor((joints[axis] + slack) / QUARTER_DEG)) for slack in (-BORDER_DEG, BORDER_DEG)}
        if pose.posture[number] not in quarters:
            raise RowFailed(f"axis {axis + 1} stands at {joints[axis]:.2f}° with confdata {[*pose.posture]}")
    if bench.services is not None:
        async with bench.robot_services() as robot:
            other = (await robot.read_pose()).posture
        if pose.posture[3] != other[3]:
            raise RowFailed(f"cfx is {pose.posture[3]} over the link, {other[3]} over Robot Web Services")
    return {"confdata": str([*pose.posture])}


async def round_trip(bench: Bench) -> Measured:
    """A goal whose numbers a single cannot hold is reached, and read back within the accuracy of the stop."""
    async with bench.wire() as wire:
        home = await bench.go_home(wire)
        goal = bench.away(home, bench.limits.fast_mm_s)
        await bench.arm(wire)
        await bench.travel(wire, goal)
        off_mm, off_rad = difference(goal.base_T_flange, (await bench.pose(wire)).base_T_flange)
        await bench.travel(wire, goal_of(home, bench.limits.fast_mm_s))
        back_mm, _ = difference(home.base_T_flange, (await bench.pose(wire)).base_T_flange)
    if max(off_mm, back_mm) > bench.limits.arrival_mm:
        raise RowFailed(f"the arm stands {max(off_mm, back_mm):.3f} mm from its goal")
    return {"away mm": round(off_mm, 4), "back mm": round(back_mm, 4), "away deg": round(float(np.degrees(off_rad)), 5)}


async def read_often(bench: Bench) -> Measured:
    """Thousands of poses are read in one connection, none lost or garbled, and few repeated."""
    times = []
    async with bench.wire() as wire:
        for _ in range(bench.limits.reads):
            exchange = await wire.ask(GetPose())
            times.append(exchange.seconds)
            if not np.all(np.isfinite(getattr(exchange.reply, "position_mm", (np.nan,)))):
                raise RowFailed("a pose that is none")
        limits, repeats = bench.limits, wire.counts.repeats
        _check_undisturbed(wire.counts, max(limits.repeats, int(limits.repeats_share * limits.reads)))
    p50, p99, worst = (round(1000 * float(value), 2) for value in (*np.quantile(times, [0.5, 0.99]), max(times)))
    return {"reads": float(len(times)), "repeats": float(repeats), "median ms": p50, "p99 ms": p99, "worst ms": worst}


async def second_client(bench: Bench) -> Measured:
    """A second client is refused BUSY, and the first goes on."""
    async with bench.wire() as wire:
        try:
            other = await Wire.open(bench.transport, bench.timing)
        except DeviceError as refused:
            if "BUSY" not in refused.what:
                raise RowFailed(f"the second client saw: {refused.what}") from refused
        else:
            await other.close(politely=False)
            raise RowFailed("a second client was served")
        await bench.report(wire)
    return {}


async def watch_log(bench: Bench) -> Measured:
    """An idle hour with a client leaves at most one entry a minute in the event log."""
    async with bench.robot_services() as robot, bench.wire() as wire:
        last = max((entry.number for entry in await robot.read_event_log()), default=0)
        ends_s = bench.timing.clock() + bench.limits.idle_s
        while bench.timing.clock() < ends_s:
            await wire.ask(Ping())
            await bench.timing.sleep(min(0.5, bench.limits.idle_s))
        new = [entry for entry in await robot.read_event_log() if entry.number > last]
    count = max((entry.number for entry in new), default=last) - last  # the log shows its newest 50, but numbers all
    if count > max(1, round(bench.limits.idle_s / 60)):
        titles = ", ".join(sorted({f"{entry.code} {entry.title}" for entry in new}))
        raise RowFailed(f"{count} entries in {bench.limits.idle_s:g} s: {titles}")
    return {"entries": float(count), "seconds": bench.limits.idle_s}


async def see_egm(bench: Bench) -> Measured:
    """EGM comes at 250 Hz, complete, and the flange stands still."""
    if bench.limits.egm_port is None:
        raise RowSkipped("no EGM port was given")
    monitor = EgmMonitor("0.0.0.0", bench.limits.egm_port, timing=bench.timing)  # noqa: S104 - whatever network it is in
    monitor.start()
    try:
        await bench.timing.sleep(2.0)
        vibration = monitor.vibration(1.0)
    finally:
        monitor.close()
    if monitor.strangers:
        raise RowFailed(f"{monitor.strangers} packets are not EGM")
    lost = vibration.lost / max(1, vibration.samples + vibration.lost)
    if lost > EGM_SHARE_LOST:
        raise RowFailed(f"{100 * lost:.0f} % of the packets are lost")
    if vibration.translation_mm > EGM_VIBRATION_MM:
        raise RowFailed(f"the flange vibrates by {vibration.translation_mm:.3f} mm")
    return {"packets a second": float(vibration.samples), "vibration mm": round(vibration.translation_mm, 4)}
