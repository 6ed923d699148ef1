"""Rows with motion: how the arm moves, stops and keeps still, with and without a person."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from calibration.transforms import Array, difference, rotation_from_vector, transform
from drivers.errors import DeviceError
from drivers.interfaces import MoveGoal, PoseReading
from drivers.robots.abb import cb_wire
from drivers.robots.abb.acceptance import person
from drivers.robots.abb.acceptance.bench import BEAT_S, Bench, RowFailed, goal_of
from drivers.robots.abb.acceptance.rows_link import Measured
from drivers.robots.abb.acceptance.wire import Wire
from protocols.cb.codes import Flag
from protocols.cb.messages import T_MS_WRAP, GetPose, Pose, Refused, Stop

CAMERA_SLACK = 1.15
WINDOW_MS = 200


async def refuse(bench: Bench) -> Measured:
    """A move is refused by name when it is not armed, outside the box, too fast, or out of reach; nothing moves."""
    async with bench.wire() as wire:
        home = await bench.go_home(wire)
        near = cb_wire.move_of(wire.device, bench.away(home, bench.limits.slow_mm_s))
        above = (near.position_mm[0], near.position_mm[1], near.position_mm[2] + 20_000.0)
        cf1, cf4, cf6, cfx = near.configuration
        rows = {
            "NOT_ARMED": near,
            "OUTSIDE_BOX": replace(near, position_mm=above),
            "SPEED": replace(near, speed_mm_s=9e4),
            "UNREACHABLE": replace(near, configuration=(cf1 + 2, cf4, cf6, cfx)),
        }
        for expected, move in rows.items():
            if expected == "OUTSIDE_BOX":
                await bench.arm(wire)
            seen = await bench.refusal(wire, move)
            if seen != expected:
                raise RowFailed(f"{expected} was expected, and {seen or 'the move was accepted'}")
        if not bench.same(await bench.pose(wire), home):
            raise RowFailed("the arm moved for a refused move")
    return {}


async def stop(bench: Bench) -> Measured:
    """STOP ends a move within the limit; the move ends ABORTED."""
    async with bench.wire() as wire:
        home = await bench.go_home(wire)
        await bench.arm(wire)
        seq, on_the_way = await bench.under_way(wire, bench.away(home, bench.limits.fast_mm_s))
        await wire.ask(Stop())
        stood, seconds = await bench.standing(wire, bench.limits.stop_s + bench.limits.margin_s)
        ended = await bench.end_of(wire, seq, 2.0)
        distance_mm, _ = difference(on_the_way.base_T_flange, stood.base_T_flange)
        if ended != "ABORTED":
            raise RowFailed(f"the stopped move ended {ended or 'never'}")
        if seconds > bench.limits.stop_s:
            raise RowFailed(f"the arm stood after {seconds:.2f} s")
        await bench.stays(wire, min(1.0, bench.limits.stand_s))
        await bench.go_home(wire)
    return {"seconds": round(seconds, 3), "mm": round(distance_mm, 2)}


async def camera_speed(bench: Bench) -> Measured:
    """While the flange turns, no point within the reach is faster than the speed asked for."""
    async with bench.wire() as wire:
        home = await bench.go_home(wire)
        await bench.arm(wire)
        goal = goal_of(home, bench.limits.fast_mm_s)
        samples = await _sample_turn(bench, wire, goal)
        await bench.travel(wire, goal)
    fastest = fastest_mm_s(samples, bench.limits.reach_mm)
    if fastest is None:
        raise RowFailed(f"the turn gave no two poses {WINDOW_MS} ms apart: nothing was measured")
    if fastest > CAMERA_SLACK * bench.limits.fast_mm_s:
        what = f"a point {bench.limits.reach_mm:g} mm from the flange moves at {fastest:.0f} mm/s"
        raise RowFailed(f"{what}, {bench.limits.fast_mm_s:g} was asked for: set cell_reach")
    return {"fastest mm/s": round(fastest, 1), "asked mm/s": bench.limits.fast_mm_s}


async def _sample_turn(bench: Bench, wire: Wire, home: MoveGoal) -> list[tuple[int, Array]]:
    """Controller's milliseconds and poses during a turn about the first of the flange's axes that allows one."""
    for axis in (sign * unit for unit in np.eye(3) for sign in (1, -1)):
        rotation = rotation_from_vector(np.radians(bench.limits.turn_deg) * axis)
        goal = replace(home, base_T_flange=home.base_T_flange @ transform(rotation, [0.0, 0.0, 0.0]))
        exchange = await wire.ask(cb_wire.move_of(wire.device, goal))
        if not isinstance(exchange.reply, Refused):
            return await _sample(bench, wire, exchange.seq)
        if exchange.reply.name != "UNREACHABLE":
            raise RowFailed(f"a turn was refused: {exchange.reply.name}")
    raise RowFailed(f"no turn of {bench.limits.turn_deg:g}° keeps the posture here: jog the arm elsewhere")


async def _sample(bench: Bench, wire: Wire, seq: int) -> list[tuple[int, Array]]:
    samples = []
    while not await bench.end_of(wire, seq, 0.001):
        raw = (await wire.ask(GetPose())).reply
        if isinstance(raw, Pose):
            samples.append((raw.t_ms, cb_wire.pose_reading(wire.device, raw, 0.0).base_T_flange))
    await bench.arrive(wire, seq)
    return samples


def fastest_mm_s(samples: list[tuple[int, Array]], reach_mm: float) -> float | None:
    """Fastest point on a sphere of `reach_mm` around the flange, over windows of WINDOW_MS; None without a window.

    `samples`: the controller's milliseconds, which wrap at T_MS_WRAP, and poses of the flange.
    """
    around = reach_mm * np.vstack([np.eye(3), -np.eye(3), np.zeros((1, 3))])
    points = np.array([pose[:3, :3] @ around.T + pose[:3, 3:] for _, pose in samples])
    stamps_ms = np.array([at for at, _ in samples])
    at_ms = np.concatenate([[0], np.cumsum(np.diff(stamps_ms) % T_MS_WRAP)])
    before = np.searchsorted(at_ms, at_ms - WINDOW_MS, side="right") - 1
    elapsed_ms = at_ms - at_ms[before]
    whole = (before >= 0) & (elapsed_ms < 2 * WINDOW_MS)
    speeds_mm_s = np.linalg.norm(points - points[before], axis=1).max(axis=1)[whole] / elapsed_ms[whole] * 1000
    return float(speeds_mm_s.max()) if len(speeds_mm_s) else None


async def borders(bench: Bench) -> Measured:
    """Goals on both sides of a quarter turn of axis 6 are reached, or refused as UNREACHABLE; none ends in an error."""
    outcomes: Measured = {}
    async with bench.wire() as wire:
        home = await bench.go_home(wire)
        await bench.arm(wire)
        axis_deg = float((await bench.joints_deg(wire))[5])
        border_deg = 90.0 * round(axis_deg / 90.0)
        for beside_deg in (-0.5, -0.005, 0.0, 0.005, 0.5):
            goal = _turned_home(home, border_deg + beside_deg, axis_deg, bench.limits.fast_mm_s)
            name = f"{border_deg + beside_deg:g}°"
            refused = await bench.refusal(wire, cb_wire.move_of(wire.device, goal))
            if refused not in ("", "UNREACHABLE"):
                raise RowFailed(f"axis 6 at {name}: {refused}")
            outcomes[name] = refused or await bench.end_of(wire, wire.last_seq, 30.0)
            if outcomes[name] not in ("OK", "UNREACHABLE"):
                raise RowFailed(f"axis 6 at {name}: the move ended {outcomes[name] or 'never'}")
        await bench.go_home(wire)
    if "OK" not in outcomes.values():
        raise RowFailed(f"no goal beside {border_deg:g}° of axis 6 is reached from here: jog the arm elsewhere")
    return outcomes


def _turned_home(home: PoseReading, wanted_deg: float, axis_deg: float, speed_mm_s: float) -> MoveGoal:
    """Home with axis 6 at `wanted_deg`: a turn about the flange's z, with the quarter that axis 6 is in then."""
    flange = rotation_from_vector([0.0, 0.0, np.radians(wanted_deg - axis_deg)])
    cf1, cf4, _, cfx = home.posture
    goal = goal_of(home, speed_mm_s)
    posture = (cf1, cf4, int(np.floor(wanted_deg / 90.0)), cfx)
    return replace(goal, base_T_flange=home.base_T_flange @ transform(flange, [0.0, 0.0, 0.0]), posture=posture)


async def keep_time(bench: Bench) -> Measured:
    """The controller's milliseconds go on evenly over a move."""
    async with bench.wire() as wire:
        home = await bench.go_home(wire)
        began_s, began_ms = bench.timing.clock(), (await bench.report(wire)).t_ms
        await bench.arm(wire)
        await bench.travel(wire, replace(bench.away(home, bench.limits.fast_mm_s)))
        await bench.travel(wire, goal_of(home, bench.limits.fast_mm_s))
        elapsed_s = bench.timing.clock() - began_s
        there_s = ((await bench.report(wire)).t_ms - began_ms) % T_MS_WRAP / 1000
    if abs(there_s - elapsed_s) > 0.1 + 0.02 * elapsed_s:
        raise RowFailed(f"{there_s:.2f} s passed at the controller, {elapsed_s:.2f} s here")
    return {"here s": round(elapsed_s, 2), "there s": round(there_s, 2)}


async def fall_silent(bench: Bench) -> Measured:
    """When the PC falls silent, the arm stands within the link's limit, and is disarmed."""
    return await _lose(bench, silent=True)


async def kill_client(bench: Bench) -> Measured:
    """When the PC's program is killed, the arm stands within the link's limit, and is disarmed."""
    return await _lose(bench)


async def pull_plug(bench: Bench) -> Measured:
    """When the plug is pulled, the arm stands within the link's limit, and is disarmed."""
    await bench.ask_person(person.HOLD_PLUG)
    return await _lose(bench, person.PULL, person.PLUG)


async def cut_power(bench: Bench) -> Measured:
    """A power cut in a slow move; started without PP to main, nothing old moves."""
    await bench.ask_person(person.CUT_CONSENT)
    return await _lose(bench, person.POWER_CUT, person.POWER_ON, restarts=True)


async def cut_power_to_main(bench: Bench) -> Measured:
    """A power cut in a slow move; after PP to main nothing old moves."""
    await bench.ask_person(person.CUT_CONSENT)
    return await _lose(bench, person.POWER_CUT, person.POWER_ON_MAIN, restarts=True)


async def _lose(
    bench: Bench,
    act: person.Step | None = None,
    then: person.Step | None = None,
    *,
    silent: bool = False,
    restarts: bool = False,
) -> Measured:
    """Lose the link in a slow move, wait until that would be over, and see how far the arm went on.

    `act`: what a person does to lose it, and `then` to mend it; without, this program falls silent, or ends.
    """
    limits = bench.limits
    speed_mm_s = limits.slow_mm_s / (2 if act else 1)  # a person needs a moment
    held_s = limits.silence_s + limits.margin_s
    allowed_mm = speed_mm_s * held_s + 2.0
    wire = await bench.reconnect(limits.reconnect_s)
    try:
        home = await bench.go_home(wire)
        await bench.arm(wire)
        goal = bench.away(home, speed_mm_s)
        _, left = await bench.under_way(wire, goal)
        session = wire.session
        if act is not None:
            await bench.ask_person(act)
            left = await _last_pose(bench, wire, left)
        rest_mm, _ = difference(left.base_T_flange, goal.base_T_flange)
        wait_s = max(rest_mm / speed_mm_s, held_s)
        if silent:
            await bench.timing.sleep(wait_s)
    finally:
        await bench.close(wire, politely=False)
    if not silent:
        await bench.timing.sleep(wait_s)
    if then is not None:
        await bench.ask_person(then)
        await bench.timing.sleep(limits.stand_s)  # an old move goes on, which the greeting would end
    async with bench.wire(patient=True) as wire:
        stood, flags = await bench.pose(wire), (await bench.report(wire)).flags
        await bench.stays(wire, min(1.0, limits.stand_s))
        travelled_mm, _ = difference(left.base_T_flange, stood.base_T_flange)
        if restarts and wire.session == session:
            raise RowFailed("the session number is that of before: the controller did not restart")
        if flags & Flag.ARMED:
            raise RowFailed("still armed after the reconnection")
        if rest_mm <= allowed_mm:
            raise RowFailed(f"{rest_mm:.0f} mm were left, {allowed_mm:.0f} may be run after the loss: nothing measured")
        if travelled_mm > allowed_mm:
            raise RowFailed(f"the arm went on for {travelled_mm:.1f} mm, {allowed_mm:.1f} is what the limit allows")
        await _home_when_ready(bench, wire)
    return {"mm": round(travelled_mm, 1)}


async def _last_pose(bench: Bench, wire: Wire, last: PoseReading) -> PoseReading:
    """The last pose that was read before the link was lost; `last` is one already. Raises RowFailed when it is not."""
    try:
        for _ in range(100):
            last = await bench.pose(wire)
            await bench.timing.sleep(BEAT_S / 2)
    except DeviceError:
        return last
    raise RowFailed("the link still answers: was it done?")


async def _interrupt(bench: Bench, act: person.Step, ends: tuple[str, ...], then: person.Step) -> Measured:
    """A move is interrupted by a person; the arm stands, and stays so when the program is started again."""
    limits = bench.limits
    async with bench.wire(patient=True) as wire:
        home = await bench.go_home(wire)
        await bench.arm(wire)
        seq, _ = await bench.under_way(wire, bench.away(home, limits.slow_mm_s))
        await bench.ask_person(act)
        ended = await bench.end_of(wire, seq, limits.travel_mm / limits.slow_mm_s + 10.0)
        await bench.standing(wire, 5.0)
        await bench.ask_person(then)  # whatever was seen: the rows behind need the controller ready
        if ended not in ends:
            raise RowFailed(f"the move ended {ended or 'never'}, expected {' or '.join(ends)}")
        if (await bench.report(wire)).flags & Flag.ARMED:
            raise RowFailed("still armed")
        await bench.stays(wire, limits.stand_s)
        await _home_when_ready(bench, wire)
    return {"ended": ended}


async def _home_when_ready(bench: Bench, wire: Wire) -> None:
    """Back to the start; the program may need a moment to answer after it was started."""
    for _ in range(19):
        with suppress(RowFailed):
            await bench.go_home(wire)
            return
        await bench.timing.sleep(0.25)
    await bench.go_home(wire)


async def press_estop(bench: Bench) -> Measured:
    """Emergency stop in a slow move; after release and start without PP to main the arm stays where it is."""
    return await _interrupt(bench, person.ESTOP, ("ESTOP", "MOTORS_OFF", "ABORTED"), person.ESTOP_RELEASE)


async def turn_key(bench: Bench) -> Measured:
    """Turning the key in a slow move stops it and disarms."""
    return await _interrupt(bench, person.TO_MANUAL, ("WRONG_MODE", "ABORTED", "MOTORS_OFF"), person.TO_AUTO)


async def release_enabling_device(bench: Bench) -> Measured:
    """In manual mode, releasing the enabling device stops a slow move."""
    await bench.ask_person(person.ENABLE)
    return await _interrupt(bench, person.DISABLE, ("MOTORS_OFF", "ABORTED", "WRONG_MODE"), person.TO_AUTO)


async def stop_program(bench: Bench) -> Measured:
    """Stop at the pendant in a slow move; after Start the old move does not go on."""
    return await _interrupt(bench, person.PROGRAM_STOP, ("WRONG_MODE", "ABORTED"), person.PROGRAM_START)


async def restart(bench: Bench) -> Measured:
    """A restart begins a new session, disarmed; the link answers again by itself."""
    async with bench.wire() as wire:
        before = wire.session
    began_s = bench.timing.clock()
    await bench.ask_person(person.RESTART)
    async with bench.wire(patient=True) as wire:
        after = wire.session
        flags = (await bench.report(wire)).flags
    if after == before:
        raise RowFailed(f"the session number is still {before}")
    if flags & Flag.ARMED:
        raise RowFailed("armed after the restart")
    return {"session": float(after), "seconds": round(bench.timing.clock() - began_s, 1)}
