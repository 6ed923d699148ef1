"""A ROS 2 node: the active calibration as a static transform, and a service that calibrates.

    python3 handeyed_node.py --ros-args -p url:=http://127.0.0.1:8372

Parameters: url, parent (tool0), child (camera_optical_frame), period_s. HANDEYED_KEY holds the API key. /tf_static is
published when another calibration is applied. `~/calibrate` (std_srvs/Trigger) moves the arm; it answers when the run
is over. Needs rclpy, tf2_ros, geometry_msgs and std_srvs; of Python nothing but the standard library.
"""

import json
import os
import urllib.error
import urllib.request
import uuid

import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from std_srvs.srv import Trigger
from tf2_ros import StaticTransformBroadcaster

READ_S, RUN_S = 5.0, 600


class HandeyedNode(Node):
    """Polls the active calibration by its ETag, which costs the daemon nothing while it stays the same."""

    def __init__(self) -> None:
        super().__init__("handeyed")
        self.declare_parameter("url", "http://127.0.0.1:8372")
        self.declare_parameter("parent", "tool0")
        self.declare_parameter("child", "camera_optical_frame")
        self.declare_parameter("period_s", 2.0)
        self._etag = ""
        self._broadcaster = StaticTransformBroadcaster(self)
        self.create_service(Trigger, "~/calibrate", self.calibrate)
        self.create_timer(self.get_parameter("period_s").value, self.publish)

    def publish(self) -> None:
        """Publish the active calibration when it is another one than before."""
        try:
            with self._open("/calibrations/current", {"If-None-Match": self._etag} if self._etag else {}) as answer:
                document, etag = json.load(answer), answer.headers["ETag"]
        except urllib.error.HTTPError as error:
            if error.code != 304:
                self.get_logger().warning(f"no calibration: {_detail(error)}")
            return
        except OSError as error:
            self.get_logger().warning(f"the daemon does not answer: {error}")
            return
        self._broadcaster.sendTransform(self.transform(document["calibration"]))
        self._etag = etag
        self.get_logger().info(f"calibration {document['calibration']['id']} is published")

    def transform(self, calibration: dict) -> TransformStamped:  # type: ignore[type-arg]
        """X in metres, from mm and w first."""
        pose, sent = calibration["flange_T_camera"], TransformStamped()
        sent.header.stamp = self.get_clock().now().to_msg()
        sent.header.frame_id = self.get_parameter("parent").value
        sent.child_frame_id = self.get_parameter("child").value
        place, turn = sent.transform.translation, sent.transform.rotation
        place.x, place.y, place.z = (value / 1000.0 for value in pose["translation_mm"])
        turn.w, turn.x, turn.y, turn.z = pose["quaternion_wxyz"]
        return sent

    def calibrate(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Run a calibration; whether it is activated is the daemon's policy."""
        try:
            with self._open(
                f"/calibrate?wait={RUN_S}", {"Idempotency-Key": str(uuid.uuid4())}, b"{}", RUN_S + READ_S
            ) as answer:
                run = json.load(answer)
        except urllib.error.HTTPError as error:
            response.success, response.message = False, _detail(error)
        except OSError as error:
            response.success, response.message = False, f"the daemon does not answer: {error}"
        else:
            response.success = run["state"] == "finished"
            response.message = json.dumps(run["result"] if response.success else run["cause"])
        return response

    def _open(self, path: str, headers: dict[str, str], body: bytes | None = None, limit_s: float = READ_S):  # type: ignore[no-untyped-def]
        if key := os.environ.get("HANDEYED_KEY"):
            headers = {**headers, "Authorization": f"Bearer {key}"}
        if body is not None:
            headers = {**headers, "Content-Type": "application/json"}
        asked = urllib.request.Request(self.get_parameter("url").value + path, body, headers)  # noqa: S310 - a parameter
        return urllib.request.urlopen(asked, timeout=limit_s)  # noqa: S310


def _detail(error: urllib.error.HTTPError) -> str:
    try:
        problem = json.load(error)
        return f"{problem['detail']}: {problem['fix']}"
    except (ValueError, KeyError, TypeError):
        return f"HTTP {error.code}"


def main() -> None:
    """Spin until the end."""
    rclpy.init()
    node = HandeyedNode()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
