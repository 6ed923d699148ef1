"""The cell on real wires: sockets, a pty, its control port, and as a process."""

import asyncio
import json
import os
import signal
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.documents.pose import PoseDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.transforms import Array, inverse, map_points, transform
from mock_robot.__main__ import main
from mock_robot.cell import MockCell, RobotProgram
from mock_robot.errors import UnknownFault
from mock_robot.scene.part import DOOR, surface_samples
from mock_robot.scene.scanner_view import cloud_ply
from mock_robot.truth.start_posture import START_DISTANCE_MM, target_middle_mm
from mock_robot.truth.truth import CellNoise, CellTruth
from protocols.cb import messages as cb
from protocols.cb.codes import Command, Flag, Status
from tests.mock_robot.cb_client import over_serial, over_tcp
from tests.mock_robot.controller_client import AWAY, HOME, move_to
from tests.mock_robot.running_cell import RunningCell, cell_process, running_cell
from tests.support.waiting import LIMIT_S, eventually

PROGRAMS = pytest.mark.parametrize("program", ["rapid", "python"])


def robot_only(**how: object):  # type: ignore[no-untyped-def]
    return running_cell(devices=False, **how)  # type: ignore[arg-type]


@PROGRAMS
async def test_a_client_arms_moves_and_reads_the_pose_over_tcp(program: RobotProgram) -> None:
    async with robot_only(program=program) as cell, over_tcp(cell.announcement.robot_port) as client:
        await client.is_armed()
        assert await client.moves(move_to(AWAY)) is Status.OK
        pose = await client.asks(cb.GetPose())
        assert isinstance(pose, cb.Pose)
        np.testing.assert_allclose(pose.position_mm, find_arm("IRB 1600-6/1.45").forward(AWAY)[:3, 3], atol=1e-3)
        assert cell.commanded_moves == 1


@PROGRAMS
async def test_the_same_over_a_serial_line(program: RobotProgram) -> None:
    async with robot_only(serial=True, program=program) as cell:
        assert cell.announcement.serial_path is not None
        async with over_serial(cell.announcement.serial_path) as client:
            await client.is_armed()
            assert await client.moves(move_to(AWAY)) is Status.OK
            assert await client.moves(move_to(HOME)) is Status.OK
        assert cell.commanded_moves == 2


@PROGRAMS
async def test_a_second_client_gets_busy_and_is_closed_and_the_first_goes_on(program: RobotProgram) -> None:
    async with robot_only(program=program) as cell, over_tcp(cell.announcement.robot_port) as first:
        await first.is_armed()
        async with over_tcp(cell.announcement.robot_port) as second:
            assert await second.asks(cb.Hello(1, 1, 2)) == cb.Refused(Status.BUSY)
            with pytest.raises(ConnectionError):
                await second.hears()
        assert await first.moves(move_to(AWAY)) is Status.OK


@PROGRAMS
async def test_a_client_that_hangs_up_leaves_a_disarmed_standing_arm_and_a_free_place(program: RobotProgram) -> None:
    async with robot_only(time_scale=1.0, program=program) as cell:
        async with over_tcp(cell.announcement.robot_port) as client:
            await client.is_armed()
            assert await client.asks(move_to(AWAY)) == cb.MoveAccepted()
            await eventually(lambda: cell.moving)
        await eventually(lambda: not cell.moving)
        assert not cell.controller.armed
        async with over_tcp(cell.announcement.robot_port) as client:
            await client.is_armed()


@pytest.mark.slow
@PROGRAMS
async def test_a_silent_client_is_stopped_after_two_seconds_and_makes_way(program: RobotProgram) -> None:
    async with robot_only(time_scale=1.0, program=program) as cell, over_tcp(cell.announcement.robot_port) as silent:
        await silent.is_armed()
        assert await silent.asks(move_to(AWAY, 20.0)) == cb.MoveAccepted()  # it takes ten times as long
        await eventually(lambda: not cell.controller.armed)
        await eventually(lambda: not cell.moving)
        async with over_tcp(cell.announcement.robot_port) as successor:
            await successor.is_armed()


@PROGRAMS
async def test_a_lost_reply_is_repeated_and_the_arm_moves_once(program: RobotProgram) -> None:
    async with robot_only(program=program) as cell, over_tcp(cell.announcement.robot_port) as client:
        await client.is_armed()
        cell.inject_fault("link-reply-lost", only=Command.MOVE)
        client.write(client.session.request(move_to(AWAY)))
        await eventually(lambda: cell.commanded_moves == 1)
        client.write(client.session.repeat())
        assert await client.is_answered() == cb.MoveAccepted()
        assert cell.controller.arm.departures == 1


@PROGRAMS
async def test_a_restart_closes_the_connection_and_shows_as_a_new_session(program: RobotProgram) -> None:
    async with robot_only(program=program) as cell:
        async with over_tcp(cell.announcement.robot_port) as client:
            await client.is_armed()
            known = client.session.session
            cell.inject_fault("link-restart")
            with pytest.raises(ConnectionError):
                await client.hears()
        async with over_tcp(cell.announcement.robot_port) as again:
            await again.asks(cb.Hello(1, 1, 9))
            assert again.session.session != known
            assert await again.asks(move_to(AWAY)) == cb.Refused(Status.NOT_ARMED)


@pytest.mark.parametrize("fault", ["link-reset", "link-close", "link-drop-mid-frame"])
@PROGRAMS
async def test_a_link_that_breaks_in_a_move_stops_and_disarms(fault: str, program: RobotProgram) -> None:
    async with robot_only(time_scale=1.0, program=program) as cell, over_tcp(cell.announcement.robot_port) as client:
        await client.is_armed()
        assert await client.asks(move_to(AWAY)) == cb.MoveAccepted()
        await eventually(lambda: cell.commanded_moves == 1)
        cell.inject_fault(fault)
        with pytest.raises(ConnectionError):
            while True:
                await client.asks(cb.GetStatus())
        await eventually(lambda: not cell.controller.armed and not cell.moving)
        assert cell.commanded_moves == 1


async def test_the_control_port_shows_the_state_and_turns_every_switch() -> None:
    async with (
        robot_only() as cell,
        httpx.AsyncClient(
            base_url=cell.announcement.control_url, trust_env=False, verify=False, timeout=LIMIT_S
        ) as client,
    ):
        state = (await client.get("/state")).json()
        assert state["moves_commanded"] == 0
        assert not state["moving"]
        assert (await client.post("/motors", json={"on": False})).json()["motors_on"] is False
        assert (await client.post("/motors?on=true")).json()["motors_on"] is True
        assert (await client.post("/mode", json={"mode": "MANR"})).json()["mode"] == "MANR"
        assert (await client.post("/emergency-stop?pressed=yes")).json()["emergency_stop"] is True
        assert (await client.post("/program?running=off")).json()["program_running"] is False
        assert (await client.post("/restart")).json()["session"] != state["session"]
        after = (await client.post("/power-failure")).json()
        assert (after["motors_on"], after["program_running"], after["armed"]) == (False, False, False)
        assert (await client.post("/pointer-to-main")).json()["program_running"] is False
        assert (await client.post("/faults/link-delay", json={"strikes": 2})).json() == {"on": ["link-delay"]}
        assert (await client.get("/state")).json()["faults"] == ["link-delay"]
        assert (await client.delete("/faults")).json() == {"on": []}
        assert len((await client.get("/faults")).json()) >= 25
        assert any("restarted" in entry["text"] for entry in (await client.get("/log")).json())


@PROGRAMS
async def test_the_arm_is_jogged_at_the_control_port_while_it_is_not_armed(program: RobotProgram) -> None:
    async with (
        robot_only(program=program) as cell,
        over_tcp(cell.announcement.robot_port) as client,
        httpx.AsyncClient(
            base_url=cell.announcement.control_url, trust_env=False, verify=False, timeout=LIMIT_S
        ) as control,
    ):
        goal = np.degrees(HOME) + np.array([5.0, 0, 0, 0, 0, 10.0])
        jogged = await control.post("/jog", json={"joints_deg": goal.tolist(), "in_s": 0.1})
        assert (jogged.status_code, jogged.json()["moving"]) == (200, True)

        async def joints() -> Array:
            return np.array((await control.get("/state")).json()["joints_deg"])

        async with asyncio.timeout(LIMIT_S):
            while np.abs(await joints() - goal).max() > 1e-3:
                pass
        pose = PoseDocument.of(find_arm("IRB 1600-6/1.45").forward(HOME)).model_dump()
        assert (await control.post("/jog", json={"base_T_flange": pose, "in_s": 0.02})).status_code == 200
        async with asyncio.timeout(LIMIT_S):
            while np.abs(await joints() - np.degrees(HOME)).max() > 1e-2:
                pass
        await client.is_armed()
        refused = await control.post("/jog", json={"joints_deg": goal.tolist()})
        assert (refused.status_code, "armed" in refused.text) == (422, True)


@pytest.mark.parametrize(
    ("method", "path", "status", "says"),
    [
        ("POST", "/jog", 422, "joints_deg"),
        ("POST", "/jog?joints_deg=12", 422, "give joints_deg"),
        ("POST", "/jog?in_s=0", 422, "in_s"),
        ("POST", "/faults/no-such", 404, "choose one of link-delay"),
        ("POST", "/motors", 422, "true, false"),
        ("POST", "/mode?mode=TURBO", 422, "AUTO, MANR, MANF"),
        ("POST", "/faults/link-delay?strikes=many", 422, "whole number"),
        ("POST", "/faults/link-delay?only=JUMP", 422, "GET_POSE"),
        ("DELETE", "/faults/no-such", 404, "choose one of"),
        ("GET", "/truth", 404, "/state"),
        ("DELETE", "/state", 405, "GET"),
    ],
)
async def test_the_control_port_says_what_is_wrong(method: str, path: str, status: int, says: str) -> None:
    async with (
        robot_only() as cell,
        httpx.AsyncClient(
            base_url=cell.announcement.control_url, trust_env=False, verify=False, timeout=LIMIT_S
        ) as client,
    ):
        response = await client.request(method, path)
        assert response.status_code == status
        assert says in response.json()["detail"]
        assert response.headers["content-type"] == "application/problem+json"


@pytest.mark.slow
async def test_camera_and_scanner_see_the_true_flange_and_their_faults_are_switched_here_too() -> None:
    imprecise = CellTruth.from_seed(7, noise=CellNoise(robot_translation_mm=1.0, robot_rotation_deg=0.1))
    async with (
        running_cell(truth=imprecise) as cell,
        httpx.AsyncClient(
            base_url=str(cell.announcement.devices_url), trust_env=False, verify=False, timeout=LIMIT_S
        ) as devices,
        httpx.AsyncClient(
            base_url=cell.announcement.control_url, trust_env=False, verify=False, timeout=LIMIT_S
        ) as client,
    ):
        announced = cell.announcement.document()
        assert (await devices.get(announced["scanner"])).content.startswith(b"ply")
        picture = await devices.get(announced["camera"])
        image = cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_GRAYSCALE)
        seen = detect(image, cell.truth.target)
        true, reported = (_projected(cell.truth, base_T_flange)[seen.ids] for base_T_flange in _flange_poses(cell))
        assert np.sqrt(np.mean((seen.corners_px - true) ** 2)) < 0.1
        assert np.sqrt(np.mean((seen.corners_px - reported) ** 2)) > 0.5, "nothing tells the arm's error"
        assert (await client.post("/faults/camera-away")).json() == {"on": ["camera-away"]}
        assert (await devices.get("/camera/snapshot.png")).status_code == 503
        assert (await devices.get("/camera/snapshot.png")).status_code == 200
        cell.inject_fault("scanner-away", strikes=2)
        cell.inject_fault("link-delay")
        assert (await client.get("/state")).json()["faults"] == ["link-delay", "scanner-away"]
        assert (await client.delete("/faults/scanner-away")).json() == {"on": ["link-delay"]}
        assert (await devices.get("/scanner/cloud.ply")).status_code == 200
        refused = await client.post("/faults/camera-black?after_moves=2")
        assert refused.status_code == 422


def _flange_poses(cell: RunningCell) -> tuple[Array, Array]:
    return cell.cell.flange_at(cell.cell.clock()), cell.controller.arm.reported_base_T_flange(0.0)


def _projected(truth: CellTruth, base_T_flange: Array) -> Array:
    camera_T_target = inverse(base_T_flange @ truth.flange_T_camera) @ truth.base_T_target
    return truth.camera.project(map_points(camera_T_target, truth.target.points_mm))


@pytest.mark.parametrize("seed", [1, 7, 23])
def test_at_the_start_the_camera_looks_at_the_target_from_600_mm(seed: int) -> None:
    cell = MockCell(CellTruth.from_seed(seed))
    base_T_camera = cell.flange_at(cell.clock()) @ cell.truth.flange_T_camera
    offset = target_middle_mm(cell.truth) - base_T_camera[:3, 3]
    assert np.linalg.norm(offset) == pytest.approx(START_DISTANCE_MM, abs=1.0)
    assert offset @ base_T_camera[:3, 2] == pytest.approx(START_DISTANCE_MM, abs=1.0)
    joints = cell.controller.arm.joints_at(0.0)
    assert cell.controller.arm.arm.singularity_clearance(joints) > 0.4


def test_an_unknown_fault_is_refused_by_name() -> None:
    with pytest.raises(UnknownFault, match="link-reset"):
        MockCell(CellTruth.from_seed(7)).inject_fault("link-gone")


@pytest.mark.slow
async def test_the_process_announces_itself_answers_and_ends_on_sigterm(tmp_path: Path) -> None:
    ready = tmp_path / "ready.json"
    options = "--seed 3 --time-scale 20 --serial --robot-only --controller python --ready-file"
    arguments = (*options.split(), str(ready))
    async with cell_process(*arguments) as cell:
        assert json.loads(ready.read_text()) == cell.announcement
        assert cell.announcement["seed"] == 3
        assert "flange_T_camera" not in json.dumps(cell.announcement).replace("flange_T_camera_guess", "")
        async with over_tcp(cell.announcement["robot"]["port"]) as client:
            await client.is_armed()
            status = await client.asks(cb.GetStatus())
            assert isinstance(status, cb.Report)
            assert status.flags & Flag.IN_POSITION
        async with over_serial(cell.announcement["robot"]["serial"]) as client:
            await client.is_armed()
        assert await cell.commanded_moves() == 0
        await cell.inject_fault("robot-emergency-stop")
        assert (await cell.state())["emergency_stop"] is True
        assert await cell.ends() == 0


@pytest.mark.slow
async def test_the_process_ends_when_its_parent_closes_standard_input() -> None:
    async with cell_process("--robot-only") as cell:
        assert cell.process.stdin is not None
        cell.process.stdin.close()
        assert await asyncio.wait_for(cell.process.wait(), LIMIT_S) == 0


@pytest.mark.slow
async def test_sigint_ends_it_too() -> None:
    async with cell_process("--robot-only") as cell:
        os.kill(cell.process.pid, signal.SIGINT)
        assert await asyncio.wait_for(cell.process.wait(), LIMIT_S) == 0


def test_truth_and_faults_are_printed_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["truth", "--seed", "7"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert first["seed"] == 7
    assert main(["faults"]) == 0
    assert "link-reply-lost" in capsys.readouterr().out
    assert main(["faults", "--json"]) == 0
    assert {"name", "area", "summary"} == set(json.loads(capsys.readouterr().out)[0])


def calibration_json(flange_T_camera: Array) -> str:
    """A calibration.json with that X."""
    return json.dumps(
        {
            "id": "c1",
            "created_at": "2026-01-01T00:00:00Z",
            "software": "handeyed",
            "setup": "eye-in-hand",
            "method": "test",
            "flange_T_camera": PoseDocument.of(flange_T_camera).model_dump(mode="json"),
            "camera": None,
            "uncertainty": None,
            "noise": {"image_px": None, "robot_rotation_deg": None, "robot_translation_mm": None},
            "views": [],
            "observability": {
                "views_used": 3,
                "max_rotation_deg": 30.0,
                "axis_spread": 0.5,
                "weakest_direction": "none",
            },
            "hold_out": None,
            "verdict": {"accepted": True, "findings": []},
        }
    )


def test_results_are_scored_against_the_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = CellTruth.from_seed(7)
    calibration, cloud = tmp_path / "calibration.json", tmp_path / "merged.ply"
    calibration.write_text(calibration_json(truth.flange_T_camera @ transform(np.eye(3), [0.0, 0.0, 0.25])))
    points = map_points(truth.base_T_part, surface_samples(10.0, DOOR)).astype(np.float32)
    cloud.write_bytes(cloud_ply(points))
    arguments = ["score", "--seed", "7", "--cloud", str(cloud), "--calibration", str(calibration)]
    assert main(arguments) == 0
    scores = json.loads(capsys.readouterr().out)
    assert scores["calibration"]["translation_mm"] == pytest.approx(0.25, abs=1e-6)
    assert scores["cloud"]["rms_mm"] < 0.01


def test_what_cannot_be_scored_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "calibration.json"
    assert main(["score", "--seed", "7"]) == 1
    assert "--cloud" in capsys.readouterr().err
    assert main(["score", "--seed", "7", "--calibration", str(missing)]) == 1
    assert "calibration.json" in capsys.readouterr().err
    missing.write_text("{}")
    assert main(["score", "--seed", "7", "--calibration", str(missing)]) == 1
    assert "id" in capsys.readouterr().err
    cloud = tmp_path / "cloud.ply"
    cloud.write_bytes(b"ply")
    assert main(["score", "--seed", "7", "--cloud", str(cloud)]) == 1
    assert capsys.readouterr().err.startswith("handeyed mock: ")


@pytest.mark.parametrize("host", ["999.1.1.1", "192.0.2.7"])
def test_a_foreign_host_on_the_command_line_is_a_sentence(host: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--host", host])
    assert f"{host} is no address of this machine" in capsys.readouterr().err


def test_a_wrong_fault_on_the_command_line_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--fault", "no-such", "--robot-only"]) == 1
    assert "no fault is named 'no-such'" in capsys.readouterr().err


@pytest.mark.parametrize("port", ["65536", "-1", "robot", "²"])
def test_a_wrong_port_on_the_command_line_is_a_sentence(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["run", f"--robot-port={port}"])
    assert f"{port} is not a port: 0 (chosen by the system) to 65535" in capsys.readouterr().err


def test_the_usage_names_the_command_as_it_is_typed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--help"])

    assert capsys.readouterr().out.startswith("usage: handeyed mock run ")
