"""deploy/ros2/handeyed_node.py with stand-ins for rclpy and the messages: no ROS can be had from PyPI."""

import asyncio
import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import pytest

from tests.daemon.calibrations import a_calibration, apply_calibration
from tests.daemon.cell_under_test import Bench

NODE = Path(__file__).resolve().parents[3] / "deploy" / "ros2" / "handeyed_node.py"


class FakeNode:
    """rclpy.node.Node as far as the node uses it."""

    parameters: ClassVar[dict[str, Any]] = {}

    def __init__(self, name: str) -> None:
        self.values: dict[str, Any] = {}
        self.lines: list[str] = []

    def declare_parameter(self, name: str, value: Any) -> None:
        self.values[name] = self.parameters.get(name, value)

    def get_parameter(self, name: str) -> Any:
        return SimpleNamespace(value=self.values[name])

    def create_service(self, *_: Any) -> None: ...

    def create_timer(self, *_: Any) -> None: ...

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: 0))

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.lines.append, info=self.lines.append)


class FakeBroadcaster:
    """tf2_ros.StaticTransformBroadcaster."""

    def __init__(self, node: Any) -> None:
        self.sent: list[Any] = []

    def sendTransform(self, transform: Any) -> None:
        self.sent.append(transform)


def a_transform() -> Any:
    empty = SimpleNamespace
    return empty(header=empty(), transform=empty(translation=empty(), rotation=empty()))


@pytest.fixture
def node_of(monkeypatch: pytest.MonkeyPatch) -> Any:
    for name, content in {
        "rclpy": {}, "rclpy.node": {"Node": FakeNode}, "geometry_msgs": {}, "std_srvs": {},
        "geometry_msgs.msg": {"TransformStamped": a_transform},
        "std_srvs.srv": {"Trigger": SimpleNamespace(Request=object, Response=object)},
        "tf2_ros": {"StaticTransformBroadcaster": FakeBroadcaster},
    }.items():  # fmt: skip
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("handeyed_node", NODE)
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)

    def make(url: str) -> Any:
        monkeypatch.setattr(FakeNode, "parameters", {"url": url.rstrip("/")})
        return loaded.HandeyedNode()

    return make


async def test_the_calibration_in_force_is_published_once(bench: Bench, node_of: Any) -> None:
    node = node_of(str(bench.client.base_url))
    await asyncio.to_thread(node.publish)
    assert node._broadcaster.sent == []
    assert "no calibration is active" in node.lines[-1]
    await apply_calibration(bench)
    for _ in range(2):
        await asyncio.to_thread(node.publish)
    (sent,) = node._broadcaster.sent
    x = a_calibration("cal-1").flange_T_camera
    assert x is not None
    place, turn = sent.transform.translation, sent.transform.rotation
    assert [place.x * 1000, place.y * 1000, place.z * 1000] == pytest.approx(x.translation_mm)
    assert [turn.w, turn.x, turn.y, turn.z] == pytest.approx(x.quaternion_wxyz)
    assert (sent.header.frame_id, sent.child_frame_id) == ("tool0", "camera_optical_frame")


async def test_the_service_calibrates_and_says_why_not(bench: Bench, node_of: Any) -> None:
    node = node_of(str(bench.client.base_url))
    answer = await asyncio.to_thread(node.calibrate, None, SimpleNamespace())
    assert answer.success, answer.message
    assert "calibration_id" in answer.message
    gone = node_of("http://127.0.0.1:1")
    answer = await asyncio.to_thread(gone.calibrate, None, SimpleNamespace())
    assert not answer.success
    assert "does not answer" in answer.message
