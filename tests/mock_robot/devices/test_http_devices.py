"""Camera and scanner over HTTP: what they serve is true, and each fault is seen as it is named."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable

import cv2
import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.detection.detect import detect
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from mock_robot.devices.http_devices import DeviceApp
from mock_robot.errors import NoSuchState, UnknownFault
from mock_robot.faults.board import FaultBoard
from mock_robot.faults.tables import DEVICE_FAULTS
from mock_robot.scene.camera_view import facing
from mock_robot.scene.part import DOOR
from mock_robot.scene.printed_target import print_target
from mock_robot.truth.score import UnreadablePly, read_points
from mock_robot.truth.truth import NO_NOISE, CellTruth
from mock_robot.truth.truth_sheet import scan_poses_of
from tests.mock_robot.controller_client import bare_controller
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

TRUTH = CellTruth.from_seed(7, noise=NO_NOISE)
PICTURE, CLOUD = "/camera/snapshot.png", "/scanner/cloud.ply"


def looking_at_the_target(distance_mm: float = 620.0) -> Array:
    """base_T_flange."""
    tilted = transform(rotation_from_vector([0.2, -0.1, 0.0]), [0.0, 0.0, 0.0])
    view = transform(np.eye(3), [0, 0, distance_mm]) @ tilted @ transform(np.eye(3), [0, 0, -distance_mm])
    camera_T_target = view @ facing(distance_mm, print_target(TRUTH.target, TRUTH.sheet))
    base_T_flange: Array = TRUTH.base_T_target @ inverse(camera_T_target) @ inverse(TRUTH.flange_T_camera)
    return base_T_flange


class Cell:
    """The devices, asked as a client asks them."""

    def __init__(self, flange_now: Callable[[], Array]) -> None:
        self.faults = FaultBoard(DEVICE_FAULTS)
        app = DeviceApp(TRUTH, flange_now, self.faults)
        self.client = httpx.AsyncClient(transport=httpx.ASGITransport(app=app), base_url="http://mock", timeout=LIMIT_S)

    async def ask(self, path: str) -> httpx.Response:
        return await self.client.get(path)

    async def picture(self) -> NDArray[np.uint8]:
        content = (await self.ask(PICTURE)).content
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert image is not None
        return np.asarray(image, np.uint8)


@pytest.fixture
async def at() -> AsyncIterator[Callable[[Callable[[], Array]], Cell]]:
    """Devices on a flange whose pose is asked for by a function."""
    cells: list[Cell] = []

    def build(pose: Callable[[], Array]) -> Cell:
        cells.append(Cell(pose))
        return cells[-1]

    yield build
    for cell in cells:
        await cell.client.aclose()


At = Callable[[Callable[[], Array]], Cell]


async def test_the_picture_shows_the_target_where_the_truth_projects_it(at: At) -> None:
    pose = looking_at_the_target()
    cell = at(lambda: pose)

    answer = await cell.ask(PICTURE)
    found = detect(await cell.picture(), TRUTH.target)

    assert answer.headers["content-type"] == "image/png"
    camera_T_target = inverse(pose @ TRUTH.flange_T_camera) @ TRUTH.base_T_target
    true_px = TRUTH.camera.project(map_points(camera_T_target, TRUTH.target.points_mm))[found.ids]
    assert len(found.ids) == 88
    assert (found.corners_px - true_px).std() < 0.07


async def test_the_cloud_lies_on_the_true_part(at: At) -> None:
    pose = scan_poses_of(TRUTH)[1]
    answer = await at(lambda: pose).ask(CLOUD)

    assert answer.headers["content-type"] == "application/x-ply"
    points = read_points(answer.content)[::50]
    in_part = map_points(inverse(TRUTH.base_T_part) @ pose @ TRUTH.flange_T_scanner, points)
    assert len(points) > 3000
    assert np.abs(DOOR.deviation(in_part)).max() < 1e-3


async def test_every_capture_says_its_age_and_number_and_has_its_own_noise(at: At) -> None:
    pose = looking_at_the_target()
    cell = at(lambda: pose)
    first, second = await cell.ask(PICTURE), await cell.ask(PICTURE)
    assert (first.headers["x-capture-id"], second.headers["x-capture-id"]) == ("1", "2")
    assert float(first.headers["x-taken-at-age-s"]) == float(second.headers["x-taken-at-age-s"]) == 0.0
    assert first.headers["cache-control"] == "no-store"
    assert first.content != second.content


async def test_a_preview_is_a_small_sketch_of_the_same_view(at: At) -> None:
    pose = looking_at_the_target()
    answer = await at(lambda: pose).ask(f"{PICTURE}?width=960")
    assert (answer.headers["content-type"], answer.headers["x-scales-by"]) == ("image/jpeg", "width")
    small = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert small is not None and small.shape == (600, 960)
    found = detect(np.asarray(small, np.uint8), TRUTH.target)
    camera_T_target = inverse(pose @ TRUTH.flange_T_camera) @ TRUTH.base_T_target
    true_px = TRUTH.camera.project(map_points(camera_T_target, TRUTH.target.points_mm))[found.ids]
    assert len(found.ids) == 88
    assert np.abs(2 * found.corners_px + 0.5 - true_px).max() < 2.0


async def test_previews_change_no_capture(at: At) -> None:
    pose = looking_at_the_target()
    plain, previewed = at(lambda: pose), at(lambda: pose)
    captures = [await plain.ask(PICTURE) for _ in range(2)]
    beside = []
    for _ in range(2):
        await previewed.ask(f"{PICTURE}?width=480")
        beside.append(await previewed.ask(PICTURE))
    assert [answer.content for answer in beside] == [answer.content for answer in captures]
    assert [answer.headers["x-capture-id"] for answer in beside] == ["1", "2"]


async def test_two_pictures_of_a_standing_camera_differ_by_their_noise_alone(at: At) -> None:
    cell = at(looking_at_the_target)
    pictures = [await cell.picture(), await cell.picture()]
    first, second = (cv2.GaussianBlur(one.astype(float), (0, 0), 6.0) for one in pictures)
    assert np.abs(first - second).max() < 8.0  # 3 are measured; other surroundings: tens


async def test_a_picture_taken_in_motion_is_smeared(at: At) -> None:
    pose, calls = looking_at_the_target(), [0]

    def moving() -> Array:
        calls[0] += 1
        moved: Array = pose @ transform(np.eye(3), [6.0 * calls[0], 4.0 * calls[0], 0.0])
        return moved

    still, smeared = await at(lambda: pose).picture(), await at(moving).picture()

    def sharpness(image: NDArray[np.uint8]) -> float:
        """Of the steepest edges, noise smoothed away."""
        smooth = cv2.GaussianBlur(image, (0, 0), 2.0).astype(float)
        return float(np.percentile(np.hypot(*np.gradient(smooth)), 99.5))

    assert sharpness(smeared) < 0.75 * sharpness(still)


async def test_the_loop_goes_on_while_a_picture_is_rendered(at: At, monkeypatch: pytest.MonkeyPatch) -> None:
    rendering, loop_turned = threading.Event(), threading.Event()
    seen: list[bool] = []

    def slow_picture(*_: object) -> NDArray[np.uint8]:
        rendering.set()
        seen.append(loop_turned.wait(LIMIT_S))
        return np.zeros((4, 4), np.uint8)

    monkeypatch.setattr("mock_robot.devices.http_devices.picture", slow_picture)
    pose = looking_at_the_target()
    asking = asyncio.create_task(at(lambda: pose).ask(PICTURE))
    await asyncio.to_thread(rendering.wait, LIMIT_S)
    loop_turned.set()
    await asking
    assert seen == [True]


async def test_the_truth_is_served_nowhere(at: At) -> None:
    cell = at(looking_at_the_target)
    for path in ("/", "/truth", "/camera", "/scanner", "/openapi.json"):
        assert (await cell.ask(path)).status_code == 404
    assert (await cell.client.post(PICTURE)).status_code == 405


# --- faults ---


async def spoiled(cell: Cell, fault: str) -> httpx.Response:
    cell.faults.switch_on(fault, bare_controller(), 0.0)
    return await cell.ask(PICTURE if fault.startswith("camera") else CLOUD)


def decoded(answer: httpx.Response) -> NDArray[np.uint8]:
    return np.asarray(cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE), np.uint8)


async def test_camera_faults_spoil_one_picture_each(at: At) -> None:
    pose = looking_at_the_target()
    cell = at(lambda: pose)

    assert decoded(await spoiled(cell, "camera-black")).max() == 0
    assert decoded(await spoiled(cell, "camera-saturated")).min() == 255
    assert decoded(await spoiled(cell, "camera-wrong-size")).shape == (600, 960)
    assert (await spoiled(cell, "camera-away")).status_code == 503
    assert (await spoiled(cell, "camera-empty-file")).content == b""
    half = (await spoiled(cell, "camera-half-file")).content
    assert half.startswith(b"\x89PNG")
    assert not half.endswith(b"IEND\xaeB`\x82")
    hidden = decoded(await spoiled(cell, "camera-target-hidden"))
    assert hidden.shape == (1200, 1920)
    assert np.percentile(hidden, 99) < 160, "no white paper in sight"

    assert not cell.faults.active
    assert len(detect(await cell.picture(), TRUTH.target).ids) == 88


async def test_a_torn_picture_has_its_lower_half_shifted(at: At) -> None:
    pose = looking_at_the_target()
    cell = at(lambda: pose)
    whole, torn = await cell.picture(), decoded(await spoiled(cell, "camera-torn"))
    upper, lower = slice(0, 600), slice(600, 1200)
    assert np.abs(whole[upper].astype(int) - torn[upper]).mean() < np.abs(whole[lower].astype(int) - torn[lower]).mean()
    assert np.abs(np.roll(whole[lower].astype(int), 120, axis=1) - torn[lower])[:, 120:].mean() < 25


@pytest.mark.parametrize(("fault", "honest"), [("camera-stale", True), ("camera-repeated", False)])
async def test_a_repeated_picture_comes_until_it_is_cleared(at: At, fault: str, honest: bool) -> None:
    pose = looking_at_the_target()
    cell = at(lambda: pose)
    first = await cell.ask(PICTURE)
    again = await spoiled(cell, fault)
    once_more = await cell.ask(PICTURE)
    assert again.content == first.content == once_more.content
    assert (once_more.headers["x-capture-id"] == first.headers["x-capture-id"]) is honest
    assert (float(once_more.headers["x-taken-at-age-s"]) > 0.0) is honest

    cell.faults.clear(bare_controller(), 0.0, fault)
    assert (await cell.ask(PICTURE)).content != first.content


async def test_scanner_faults_spoil_one_cloud_each(at: At) -> None:
    pose = scan_poses_of(TRUTH)[1]
    cell = at(lambda: pose)
    assert len(read_points((await spoiled(cell, "scanner-empty")).content)) == 0
    holes = np.isnan(read_points((await spoiled(cell, "scanner-nan")).content)).all(axis=1)
    assert np.mean(holes) == pytest.approx(0.1, abs=1e-3)
    with pytest.raises(UnreadablePly, match="promises"):
        read_points((await spoiled(cell, "scanner-half-file")).content)
    assert (await spoiled(cell, "scanner-away")).status_code == 503
    assert np.isfinite(read_points((await cell.ask(CLOUD)).content)).all()


@pytest.mark.parametrize("device", ["camera", "scanner"])
async def test_a_late_answer_is_late(at: At, device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[float] = []
    really = asyncio.sleep

    async def sleep(seconds: float) -> None:
        waited.append(seconds)
        await really(0)

    pose = looking_at_the_target() if device == "camera" else scan_poses_of(TRUTH)[1]
    cell = at(lambda: pose)
    monkeypatch.setattr("mock_robot.devices.http_devices.asyncio.sleep", sleep)
    await spoiled(cell, f"{device}-late")
    assert max(waited) == DEVICE_FAULTS[f"{device}-late"].delay_s


def test_a_fault_strikes_as_often_as_it_is_set_to() -> None:
    board = FaultBoard(DEVICE_FAULTS)
    board.switch_on("camera-black", bare_controller(), 0.0, strikes=2)
    struck = [[fault.name for fault in board.strike_device("camera")] for _ in range(3)]
    assert struck == [["camera-black"], ["camera-black"], []]


def test_a_fault_of_one_device_leaves_the_other_alone() -> None:
    board, controller = FaultBoard(DEVICE_FAULTS), bare_controller()
    board.switch_on("scanner-empty", controller, 0.0)
    assert board.strike_device("camera") == ()
    assert list(board.active) == ["scanner-empty"]
    board.clear(controller, 0.0)
    assert not board.active


def test_a_fault_of_a_device_waits_for_no_request_and_no_move() -> None:
    with pytest.raises(NoSuchState, match="only or after_moves"):
        FaultBoard(DEVICE_FAULTS).switch_on("camera-black", bare_controller(), 0.0, after_moves=1)


def test_an_unknown_fault_is_refused_with_those_there_are() -> None:
    with pytest.raises(UnknownFault, match="camera-black"):
        FaultBoard(DEVICE_FAULTS).switch_on("camera-on-fire", bare_controller(), 0.0)
    with pytest.raises(UnknownFault, match="scanner-nan"):
        FaultBoard(DEVICE_FAULTS).clear(bare_controller(), 0.0, "camera-on-fire")
