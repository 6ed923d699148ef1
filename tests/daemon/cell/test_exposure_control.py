"""Exposure chosen for the target: in bright, dark and changing light it is found nearly as well as in ideal light."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.targets import Charuco
from daemon.cell.exposure_control import ExposureControl, next_exposure, within
from daemon.config.settings import ExposureSettings
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from drivers.interfaces import CameraFrame, Exposure, ExposureRange
from mock_robot.scene.optics import Optics
from tests.simulated.views import TruePicture, industrial_camera, take_picture

IDEAL = Optics(background=0.3)
CAMERA, TARGET = industrial_camera(640, 480), Charuco(7, 5, 30.0, 22.0, "DICT_4X4_50")
IDEAL_EXPOSURE_US = 10_000.0
RANGE = ExposureRange((20.0, 1_000_000.0), (0.0, 24.0))
LIMITS = ExposureSettings(exposure_us=(20.0, 200_000.0))
VIEWS = 4
CLOCK = Clock()


@pytest.fixture
def workers():
    pool = Workers(CLOCK)
    yield pool
    pool.close()


class LitCamera:
    """The mock's picture of a view in its light: levels grow with light, exposure time and gain, noise with gain."""

    def __init__(self, exposure_us: float = IDEAL_EXPOSURE_US) -> None:
        self.view, self.light, self.set_to, self.pictures = 0, 1.0, Exposure(exposure_us), 0
        self.taken: TruePicture | None = None

    async def read_exposure(self):
        return self.set_to, RANGE

    async def set_exposure(self, wanted: Exposure) -> Exposure:
        assert LIMITS.exposure_us[0] <= wanted.exposure_us <= LIMITS.exposure_us[1]
        assert LIMITS.gain_db[0] <= wanted.gain_db <= LIMITS.gain_db[1]
        self.set_to = wanted
        return wanted

    async def grab(self, newer_than_s: float) -> CameraFrame:
        self.pictures += 1
        gain = 10 ** (self.set_to.gain_db / 20)
        optics = replace(
            IDEAL,
            exposure=self.light * self.set_to.exposure_us / IDEAL_EXPOSURE_US * gain,
            read_noise=IDEAL.read_noise * gain,
            electrons_per_level=IDEAL.electrons_per_level / gain,
        )
        self.taken = take_picture(CAMERA, TARGET, np.random.default_rng(self.view), optics)
        return CameraFrame(self.taken.image, newer_than_s + 1e-3)


def errors_px(picture):
    seen = detect(picture.image, TARGET)
    return np.linalg.norm(seen.corners_px - picture.pixels[seen.ids], axis=1)


def rms(errors):
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "lights",
    [[30.0], [0.06], [8.0, 0.1, 20.0, 0.3]],
    ids=["bright", "dark", "changing"],
)
async def test_the_target_is_found_nearly_as_exactly_as_in_ideal_light(lights, workers):
    camera = LitCamera()
    control = ExposureControl(camera, TARGET, LIMITS, workers, CLOCK)
    ideal, adjusted = [], []
    for camera.view in range(VIEWS):
        camera.light = lights[camera.view % len(lights)]
        await control.expose(camera.grab, 0.0)
        assert not (camera.taken.image >= 255).mean() > 0.01
        adjusted.append(errors_px(camera.taken))
        ideal.append(errors_px(take_picture(CAMERA, TARGET, np.random.default_rng(camera.view), IDEAL)))
    assert rms(adjusted) <= 1.2 * rms(ideal)


async def test_a_well_exposed_view_costs_one_picture(workers):
    camera = LitCamera()
    await ExposureControl(camera, TARGET, LIMITS, workers, CLOCK).expose(camera.grab, 0.0)
    assert camera.pictures == 1 and camera.set_to == Exposure(IDEAL_EXPOSURE_US)


async def test_too_little_light_ends_at_the_users_limits(workers):
    camera = LitCamera()
    camera.light = 1e-4
    await ExposureControl(camera, TARGET, LIMITS, workers, CLOCK).expose(camera.grab, 0.0)
    assert camera.set_to == Exposure(200_000.0, 6.0)


async def test_a_camera_that_cannot_be_adjusted_is_left_alone(workers):
    class Plain:
        async def grab(self, newer_than_s):
            return CameraFrame(np.zeros((48, 64), np.uint8), 1.0)

    frame = await ExposureControl(Plain(), TARGET, LIMITS, workers, CLOCK).expose(Plain().grab, 0.0)
    assert frame.taken_at_s == 1.0


@pytest.mark.parametrize(
    ("level", "now", "wanted"),
    [
        (190, Exposure(1000.0), None),
        (255, Exposure(1000.0), Exposure(300.0)),
        (255, Exposure(1000.0, 6.0), Exposure(1000.0 * 10**0.3 * 0.3)),
        (39, Exposure(1000.0), Exposure(5_000.0)),
        (19, Exposure(200_000.0, 6.0), None),
        (255, Exposure(20.0), None),
    ],
    ids=["well", "saturated", "gain back first", "dark", "no more light", "no less light"],
)
def test_the_next_exposure(level, now, wanted):
    limits = ExposureRange((20.0, 200_000.0), (0.0, 6.0))
    found = next_exposure(np.full((40, 40), level, np.uint8), None, now, limits)
    if wanted is None:
        assert found is None
    else:
        assert (found.exposure_us, found.gain_db) == (pytest.approx(wanted.exposure_us), pytest.approx(wanted.gain_db))


@pytest.mark.parametrize(
    ("user", "both"),
    [((100.0, 500.0), (100.0, 500.0)), ((1.0, 1e6), (50.0, 1000.0)), ((1.0, 20.0), (50.0, 50.0)),
     ((5000.0, 9000.0), (1000.0, 1000.0))],
)  # fmt: skip
def test_limits_that_the_camera_cannot_keep_are_kept_as_nearly_as_it_can(
    user: tuple[float, float], both: tuple[float, float]
) -> None:
    found = within(ExposureSettings(exposure_us=user), ExposureRange((50.0, 1000.0), (0.0, 20.0)))
    assert (found.exposure_us, found.gain_db) == (both, (0.0, 6.0))
