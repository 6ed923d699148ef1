"""A PLC runs the cell: the same work by the same door as over REST, told in registers."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from calibration.transforms import transform_from_quaternion
from daemon.config.plc_settings import PlcSettings
from daemon.errors import PortTaken
from drivers.errors import LinkLost
from protocols.modbus.words import WordOrder, crc16
from protocols.plc.codes import ContentsBit, ControlBit, DriftState, PlcCommand, PlcVerdict, StatusBit
from protocols.plc.registers import BY_NAME, RESULT, SIZE
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Parts, pose_json, serving, settings_for
from tests.daemon.fakes import FLANGE_T_CAMERA, Gate, poses_around_the_target
from tests.daemon.named_cameras import two_cameras
from tests.extensions.plc.plcs import MOVING, ladder, plc_of, value_of
from tests.support.waiting import LIMIT_S

C, S = ControlBit, StatusBit


async def test_calibrate_verify_and_register_by_handshake(tmp_path: Path) -> None:
    scanner = {"address": "http://scanner/cloud.ply", "poses": [pose_json(p) for p in poses_around_the_target(2)]}
    settings = settings_for(tmp_path, plc=MOVING, scanner=scanner, calibration={"policy": "auto", "tolerance_mm": 20.0})
    async with serving(settings) as bench, ladder(bench) as plc:
        await plc.client.write_registers(3, [1, 4464])  # part 70000
        await plc.sets(C(0))
        assert not await plc.waits(S.READY | S.ONLINE) & (S.CALIBRATION_IN_FORCE | S.ERROR)
        begin = value_of(await plc.image(), "result_id")
        assert not await plc.triggers(C.TRIGGER_CALIBRATE) & S.ERROR

        image = await plc.result()
        run = (await bench.client.get("/runs")).json()["runs"][0]
        assert (run["kind"], run["id"]) == ("calibration", value_of(image, "run_id"))
        assert value_of(image, "result_command") == PlcCommand.CALIBRATE
        assert value_of(image, "verdict") == PlcVerdict.ACCEPTED
        assert (
            value_of(image, "contents") & (ContentsBit.X | ContentsBit.UNCERTAINTY)
            == ContentsBit.X | ContentsBit.UNCERTAINTY
        )
        assert value_of(image, "result_part") == 70000
        assert value_of(image, "result_stations") == value_of(image, "station") == 5
        x = [value_of(image, f"x_{axis}") for axis in "xyz"]
        found = transform_from_quaternion(x, [value_of(image, f"q_{axis}") for axis in "wxyz"])
        assert np.abs(found - FLANGE_T_CAMERA)[:3, 3].max() < 0.5
        assert [value_of(image, f"x_um_{axis}") for axis in "xyz"] == [round(1e3 * value) for value in x]
        assert 0 < value_of(image, "sigma_point") < 1.0

        await plc.waits(S.CALIBRATION_IN_FORCE | S.COMPLETED | S.READY)
        await plc.triggers(C.TRIGGER_VERIFY)
        image = await plc.result()
        assert (value_of(image, "result_command"), value_of(image, "verdict")) == (
            PlcCommand.VERIFY,
            PlcVerdict.ACCEPTED,
        )
        assert value_of(image, "contents") & ContentsBit.DEVIATION
        assert 0 < value_of(image, "deviation") < 0.5
        assert value_of(image, "drift_state") in (DriftState.OFF, DriftState.LEARNING)

        await plc.waits(S.READY)
        await plc.triggers(C.TRIGGER_REGISTER)
        image = await plc.result()
        scan = (await bench.client.get("/scans")).json()["scans"][0]
        assert scan["name"] == "part 70000"
        assert len(scan["views"]) == 2
        assert value_of(image, "result_command") == PlcCommand.REGISTER
        assert value_of(image, "verdict") in (PlcVerdict.ACCEPTED, PlcVerdict.REJECTED, PlcVerdict.FAILED)
        ids = [value_of(image, name) for name in ("result_number", "result_acquisition", "result_id")]
        assert ids == [(begin + 2) % 65535 + 1] * 3


@pytest.mark.parametrize(("tolerance_um", "verdict"), [(20_000, PlcVerdict.ACCEPTED), (0, PlcVerdict.REJECTED)])
async def test_a_plc_states_the_tolerance(tmp_path: Path, tolerance_um: int, verdict: PlcVerdict) -> None:
    settings = settings_for(tmp_path, plc=MOVING, calibration={"tolerance_mm": 1e-7})
    async with serving(settings) as bench, ladder(bench) as plc:
        await plc.client.write_register(BY_NAME["tolerance_wanted"].address, tolerance_um)
        await plc.sets(C(0))
        await plc.waits(S.READY | S.ONLINE)
        assert not await plc.triggers(C.TRIGGER_CALIBRATE) & S.ERROR
        image = await plc.result()
        assert value_of(image, "verdict") == verdict
        found = (await bench.client.get(f"/calibrations/{value_of(image, 'run_id')}")).json()
        assert found["verdict"]["limits"]["tolerance_mm"] == (tolerance_um / 1e3 or 1e-7)
        worst_mm = max(point["expanded_mm"] for point in found["uncertainty"]["points"])
        assert value_of(image, "contents") & ContentsBit.WORST_POINT
        assert value_of(image, "u_worst") == pytest.approx(worst_mm, rel=1e-6)
        assert value_of(image, "u_worst_um") == round(1e3 * worst_mm)


REFUSALS = {
    "motors off": ({"motors_on": False}, C.TRIGGER_CALIBRATE, 12, 503, "/calibrate"),
    "emergency stop": ({"emergency_stop": True}, C.TRIGGER_REGISTER, 12, 503, "/scans"),
    "verify without a calibration": ({}, C.TRIGGER_VERIFY, 17, 409, "/verify"),
}


@pytest.mark.parametrize(("robot", "trigger", "number", "status", "path"), REFUSALS.values(), ids=REFUSALS.keys())
async def test_refusals_are_those_of_rest(
    tmp_path: Path, robot: dict[str, bool], trigger: ControlBit, number: int, status: int, path: str
) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        if trigger is not C.TRIGGER_VERIFY:
            await apply_calibration(bench, "cal-7")
        bench.robot.status = robot
        body = {"capture": True} if path == "/scans" else {}
        assert (await bench.client.post(path, json=body)).status_code == status
        await plc.waits(S.ONLINE)
        assert await plc.triggers(trigger) & S.ERROR
        assert value_of(await plc.image(), "error_code") == number
        assert not bench.robot.goals
        await plc.sets(C.CLEAR_ERROR)
        assert not await plc.status() & S.ERROR


async def test_a_run_of_rest_is_seen_refused_beside_and_stopped_by_the_plc(tmp_path: Path) -> None:
    parts = Parts()
    gate = parts.robot.before_move = Gate(at_move=2)
    async with serving(settings_for(tmp_path, plc=MOVING), parts) as bench, ladder(bench) as plc:
        await plc.sets(C(0))
        await plc.waits(S.READY)
        started = await bench.client.post("/calibrate")
        await gate.reached.wait()
        await plc.waits(S.ONLINE, unwanted=S.READY)
        assert await plc.triggers(C.TRIGGER_CALIBRATE) & S.ERROR
        assert value_of(await plc.image(), "error_code") == 10
        await plc.sets(C.ABORT)
        run = await bench.run_over(started.headers["location"])
        assert (run["state"], run["cause"]["code"]) == ("aborted", "aborted")
        assert "the PLC at 127.0.0.1" in run["cause"]["what"]


async def test_a_trigger_that_flickers_starts_one_run(tmp_path: Path) -> None:
    settings = settings_for(tmp_path, plc=MOVING)
    async with serving(settings) as bench, ladder(bench) as plc:
        await plc.sets(C(0))
        await plc.waits(S.READY)
        while not await plc.status() & S.RESULTS_VALID:
            await plc.sets(C.TRIGGER_CALIBRATE)
            await plc.sets(C(0))
        moves = len(bench.robot.goals)
        for _ in range(20):
            await plc.sets(C.TRIGGER_CALIBRATE)
            await plc.sets(C(0))
        assert not await plc.status() & (S.BUSY | S.READY)
        assert len(bench.robot.goals) == moves == 5
        assert value_of(await plc.image(), "error_code") == 5
        await plc.result()
        await plc.waits(S.READY)
        await plc.triggers(C.TRIGGER_CALIBRATE)
        await plc.result()
        assert len(bench.robot.goals) == 10


async def test_a_command_that_fails_says_why(tmp_path: Path) -> None:
    parts = Parts()
    async with serving(settings_for(tmp_path, plc=MOVING), parts) as bench, ladder(bench) as plc:
        await plc.waits(S.ONLINE)

        async def breaks(move: int) -> None:
            if move == 2:
                bench.robot.broken_with = LinkLost("robot fake", "the connection broke", "look at the cable")

        bench.robot.before_move = breaks
        await plc.triggers(C.TRIGGER_CALIBRATE)
        image = await plc.result()
        assert (value_of(image, "verdict"), value_of(image, "result_error")) == (PlcVerdict.FAILED, 30)
        assert value_of(image, "contents") == 0


async def test_without_the_words_in_the_settings_nobody_writes_and_nothing_moves(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc={"port": 0})) as bench, ladder(bench) as plc:
        await plc.waits(S.ONLINE)
        answer = await plc.client.write_register(0, int(C.TRIGGER_CALIBRATE))
        assert (answer.isError(), answer.exception_code) == (True, 1)
        assert value_of(await plc.image(), "control") == 0
    motionless = {**MOVING, "motion": False}
    async with serving(settings_for(tmp_path / "b", plc=motionless)) as bench, ladder(bench) as plc:
        await plc.waits(S.ONLINE, unwanted=S.MOTION_ALLOWED | S.READY)
        assert await plc.triggers(C.TRIGGER_CALIBRATE) & S.ERROR
        assert value_of(await plc.image(), "error_code") == 2
        assert not bench.robot.goals


async def test_the_arm_s_temperature_is_stated_with_each_write_of_it(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        temperature = BY_NAME["arm_temperature"].address
        known = bench.application.cell.arm
        await plc.client.write_register(temperature, 315)
        assert known.conditions().temperature_c == 31.5
        known.state_temperature(20.0)
        await plc.client.write_register(BY_NAME["heartbeat_in"].address, 7)
        assert known.conditions().temperature_c == 20.0, "a heartbeat does not say that the arm is as warm as before"
        await plc.client.write_registers(0, [0, 8, 0, 0, 0, 0, 0, 320])
        assert known.conditions().temperature_c == 32.0
        for none in (0, 1001, 65535):
            known.state_temperature(20.0)
            await plc.client.write_register(temperature, none)
            assert known.conditions().temperature_c == 20.0


async def test_only_listed_registers_are_written(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        for address in (8, 15, 16, 20, RESULT, SIZE - 1, SIZE, 65535):
            assert (await plc.client.write_register(address, 1)).exception_code == 2
        assert (await plc.client.write_registers(7, [1, 2])).exception_code == 2
        assert value_of(await plc.image(), "part_id") == 0
        assert (await plc.client.read_holding_registers(SIZE, count=1)).exception_code == 2


async def test_a_trigger_held_over_a_restart_moves_nothing(tmp_path: Path) -> None:
    settings = settings_for(tmp_path, plc=MOVING)
    for _ in range(2):
        async with serving(settings) as bench, ladder(bench) as plc:
            await plc.waits(S.ONLINE)
            await plc.sets(C.TRIGGER_CALIBRATE)
            await plc.sets(C.TRIGGER_CALIBRATE)
            assert not await plc.status() & (S.BUSY | S.TRIGGER_ACK | S.READY)
            assert not bench.robot.goals


async def test_a_plc_that_falls_silent_stops_what_it_started(tmp_path: Path) -> None:
    parts = Parts()
    gate = parts.robot.before_move = Gate(at_move=2)
    settings = settings_for(tmp_path, plc={**MOVING, "heartbeat_limit_s": 1.2})
    async with serving(settings, parts) as bench, ladder(bench) as plc:
        await plc.waits(S.ONLINE)
        await plc.client.write_register(1, 41)
        await plc.triggers(C.TRIGGER_CALIBRATE)
        await gate.reached.wait()
        image = await plc.result()
        assert value_of(image, "status") & S.PLC_SILENT
        assert (value_of(image, "verdict"), value_of(image, "heartbeat_echo")) == (PlcVerdict.ABORTED, 41)
        run = (await bench.client.get("/runs")).json()["runs"][0]
        assert "silence" in run["cause"]["what"]


async def test_no_read_ever_sees_a_torn_block(tmp_path: Path) -> None:
    """A reader beside the handshake: whenever a block is valid, its CRC and its number fit, and it does not change."""
    poses = [pose_json(pose) for pose in poses_around_the_target(3)]
    settings = settings_for(tmp_path, plc=MOVING, calibration={"poses": poses})
    async with serving(settings) as bench, ladder(bench) as plc, ladder(bench) as watcher:
        await plc.waits(S.ONLINE)
        seen: dict[int, set[tuple[int, ...]]] = {}
        over = asyncio.Event()

        async def watch() -> None:
            while not over.is_set():
                status = await watcher.status()
                answer = await watcher.client.read_input_registers(RESULT, count=SIZE - RESULT)
                block = tuple(answer.registers)
                if status & S.RESULTS_VALID and await watcher.status() & S.RESULTS_VALID:
                    assert block[-1] == crc16(block[:-1])
                    seen.setdefault(block[0], set()).add(block)

        watching = asyncio.create_task(watch())
        bench.robot.status = {}
        for _ in range(2):
            before = value_of(await plc.image(), "result_id")
            await plc.triggers(C.TRIGGER_CALIBRATE)
            assert value_of(await plc.result(), "result_number") == before % 65535 + 1
            await plc.waits(S.READY)
        over.set()
        await watching
        assert all(len(blocks) == 1 for blocks in seen.values()), seen


@pytest.mark.parametrize("order", WordOrder)
async def test_the_word_order_is_the_settings(tmp_path: Path, order: WordOrder) -> None:
    async with serving(settings_for(tmp_path, plc={"port": 0, "word_order": order.value})) as bench:
        async with ladder(bench) as plc:
            image = await plc.image()
        assert value_of(image, "constant_float", order) == pytest.approx(123.456, abs=1e-5)
        assert value_of(image, "constant_int", order) == 123456
        assert value_of(image, "map_version") == 1


@pytest.mark.slow
async def test_the_heartbeat_goes_on(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        counts = set()
        async with asyncio.timeout(LIMIT_S):
            while len(counts) < 3:
                counts.add(value_of(await plc.image(), "heartbeat_out"))


async def test_it_identifies_itself(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        answer = await plc.client.read_device_information(read_code=3)
        assert answer.information[0] == b"handeyed"


async def test_a_taken_port_is_reported_before_anything_starts(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc={"port": 0})) as bench:
        taken = plc_of(bench).tcp.port
        with pytest.raises(PortTaken, match=r"\[plc\] host or port"):
            async with serving(settings_for(tmp_path / "b", plc={"port": taken})):
                pass


@pytest.mark.parametrize(
    ("client", "writes"),
    [("192.168.125.10", True), ("::ffff:192.168.125.10", True), ("192.168.126.77", True), ("192.168.125.11", False),
     ("10.0.0.1", False), ("?", False), ("fe80::1%eth0", False)],
)  # fmt: skip
def test_who_may_write(client: str, writes: bool) -> None:
    assert PlcSettings(writers=("192.168.125.10", "192.168.126.0/24")).may_write(client) is writes


async def test_a_plc_names_the_camera_by_its_number(tmp_path: Path) -> None:
    async with two_cameras(tmp_path, plc=MOVING) as bench, ladder(bench) as plc:
        camera = BY_NAME["camera_wanted"].address
        await plc.sets(C(0))
        await plc.waits(S.READY)
        await plc.client.write_register(camera, 1)
        await plc.triggers(C.TRIGGER_CALIBRATE)
        await plc.result()
        assert (await bench.client.get("/calibrations/current?camera=wrist")).status_code == 200
        await plc.client.write_register(camera, 2)
        assert await plc.triggers(C.TRIGGER_CALIBRATE) & S.ERROR


async def test_a_plc_states_the_tolerance_of_a_verification_and_learns_that_it_may_not_loosen_it(
    tmp_path: Path,
) -> None:
    settings = settings_for(tmp_path, plc=MOVING, calibration={"tolerance_mm": 50.0, "requests_may_loosen": False})
    async with serving(settings) as bench, ladder(bench) as plc:
        await apply_calibration(bench)
        await plc.sets(C(0))
        await plc.waits(S.READY | S.ONLINE)
        await plc.client.write_register(BY_NAME["tolerance_wanted"].address, 50_001)
        assert await plc.triggers(C.TRIGGER_VERIFY) & S.ERROR
        assert value_of(await plc.image(), "error_code") == 26
        await plc.client.write_register(BY_NAME["tolerance_wanted"].address, 1)
        await plc.waits(S.READY)
        assert not await plc.triggers(C.TRIGGER_VERIFY) & S.ERROR
        assert value_of(await plc.result(), "verdict") == PlcVerdict.REJECTED
