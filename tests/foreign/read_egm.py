"""Read EGM with a foreign client and print what it says: `python -m tests.foreign.read_egm CLIENT COUNT`.

A process of its own: both clients register the same protobuf file, so that one process cannot hold both.
"""

import importlib
import json
import sys

from tests.support.waiting import LIMIT_S


def main(client: str, count: int) -> None:
    """Say the port, then COUNT samples."""
    egm = importlib.import_module(client).EGM(port=0)
    print(json.dumps({"port": egm.socket.getsockname()[1]}), flush=True)
    samples = []
    while len(samples) < count:
        received, state = egm.receive_from_robot(timeout=LIMIT_S)
        assert received, "nothing came"
        position, quaternion = _pose(state.cartesian)
        samples.append(
            {
                "seqno": state.robot_message.header.seqno,
                "joints_deg": [float(angle) for angle in state.joint_angles],
                "position_mm": position,
                "quaternion_wxyz": quaternion,
                "motors_on": state.motors_on,
                "running": state.rapid_running,
            }
        )
    print(json.dumps(samples), flush=True)


def _pose(cartesian: object) -> tuple[list[float], list[float]]:
    if hasattr(cartesian, "pos"):
        pos, orientation = cartesian.pos, cartesian.orient
        return [pos.x, pos.y, pos.z], [orientation.u0, orientation.u1, orientation.u2, orientation.u3]
    position, quaternion = cartesian  # type: ignore[misc]
    return [float(value) for value in position], [float(value) for value in quaternion]


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
