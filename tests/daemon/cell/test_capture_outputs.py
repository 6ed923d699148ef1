"""Light and trigger around a frame: in their order, and low again whatever fails."""

import asyncio
from typing import Any

import pytest

from daemon.cell.capture_outputs import CaptureOutputs
from daemon.config.robot_settings import OutputSettings
from daemon.config.settings import RobotSettings
from drivers.errors import DeviceTimeout

FAILURE = DeviceTimeout("camera", "no frame", "look at its cable")


class Bench:
    """A clock, a switch and a camera that note what happens in its order."""

    def __init__(self, *, camera_fails: bool = False, stuck: str = "") -> None:
        self.happened: list[str] = []
        self.now_s, self.camera_fails, self.stuck = 100.0, camera_fails, stuck
        self.high = asyncio.Event()

    async def switch_output(self, output: str, on: bool) -> None:
        self.happened.append(f"{output} {'on' if on else 'off'}")
        if output == self.stuck and not on:
            raise DeviceTimeout("robot", "no answer", "wait")
        if output == "trigger" and on:
            self.high.set()

    def monotonic_s(self) -> float:
        return self.now_s

    async def sleep(self, seconds: float) -> None:
        self.now_s += seconds
        self.happened.append(f"{seconds:g} s")
        await asyncio.sleep(0)

    async def grab(self, newer_than_s: float) -> Any:
        self.happened.append(f"waits for a frame after {newer_than_s:g} s")
        if self.camera_fails:
            raise FAILURE
        return "frame"

    async def grab_triggered(self, newer_than_s: float) -> Any:
        self.happened.append("waits for the trigger")
        await self.high.wait()
        return await self.grab(newer_than_s)

    def outputs(self, **settings: float) -> CaptureOutputs:
        switch: Any = self
        return CaptureOutputs(switch.switch_output, OutputSettings(**settings), switch)


async def test_the_light_shines_before_the_frame_and_not_after_it() -> None:
    bench = Bench()
    frame: Any = await bench.outputs(light_s=0.2).capture(bench.grab, 99.0)
    assert frame == "frame"
    assert bench.happened == ["light on", "0.2 s", "waits for a frame after 100.2 s", "light off"]


async def test_the_trigger_rises_when_the_camera_waits_for_it() -> None:
    bench = Bench()
    frame: Any = await bench.outputs(trigger_s=0.05).capture(bench.grab_triggered, 99.0)
    assert frame == "frame"
    assert bench.happened[:2] == ["waits for the trigger", "trigger on"]
    assert "trigger off" in bench.happened


@pytest.mark.parametrize("settings", [{"light_s": 0.1}, {"trigger_s": 0.1}, {"light_s": 0.1, "trigger_s": 0.1}])
async def test_every_output_is_low_after_a_frame_that_failed(settings: dict[str, float]) -> None:
    bench = Bench(camera_fails=True)
    with pytest.raises(DeviceTimeout, match="no frame"):
        await bench.outputs(**settings).capture(bench.grab, 99.0)
    for name in settings:
        last = [each for each in bench.happened if each.startswith(name.removesuffix("_s"))][-1]
        assert last.endswith("off")


async def test_a_frame_is_not_lost_when_the_light_stays_on() -> None:
    bench = Bench(stuck="light")
    frame: Any = await bench.outputs(light_s=0.0).capture(bench.grab, 99.0)
    assert frame == "frame"


def test_outputs_need_the_link_that_switches_them() -> None:
    box = [[0, -500, 0], [900, 500, 900]]
    with pytest.raises(ValueError, match="CB link"):
        RobotSettings.model_validate({"address": "rws://10.0.0.1", "box_mm": box, "outputs": {"light_s": 0.1}})
