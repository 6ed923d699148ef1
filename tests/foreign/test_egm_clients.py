"""abb_robot_client.egm and ABBRobotEGM, unmodified, read the mock's EGM; and their protobuf reads and feeds ours."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

from protocols.egm.messages import RobotSample, decode, encode
from tests.foreign.client_checks import held_by
from tests.mock_robot.rws_cell import rws_cell_apart

ROOT = Path(__file__).parents[2]
CLIENTS = ("abb_robot_client.egm", "ABBRobotEGM")


def _needs(client: str) -> None:
    if importlib.util.find_spec(client.partition(".")[0]) is None:
        pytest.skip(f"{client} is not installed")


@pytest.mark.parametrize("client", CLIENTS)
def test_a_foreign_client_reads_pose_and_joints_of_the_mock(client: str) -> None:
    _needs(client)
    command = [sys.executable, "-m", "tests.foreign.read_egm", client, "25"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        port = json.loads(process.stdout.readline())["port"]
        with rws_cell_apart(egm=("127.0.0.1", port)) as cell:
            samples = json.loads(process.stdout.readline())
            held, joints = held_by(cell), cell.world.joints_deg
    assert [sample["seqno"] for sample in samples[1:]] == [sample["seqno"] + 1 for sample in samples[:-1]]
    for sample in samples:
        numbers = [*sample["position_mm"], *sample["quaternion_wxyz"]]
        assert [f"{number:.9g}" for number in numbers] == list(held.values())
        assert sample["joints_deg"] == pytest.approx(list(joints), abs=1e-5)
        assert sample["motors_on"]
        assert sample["running"]


THEIRS = """
import sys
from abb_robot_client._egm_protobuf import egm_pb2
message = egm_pb2.EgmRobot()
message.ParseFromString(bytes.fromhex(sys.argv[1]))
assert message.IsInitialized()
message.measuredForce.force.extend([1.0] * 6)
message.testSignals.signals.extend([0.5, 0.25])
message.moveIndex = 3
sys.stdout.write(message.SerializeToString().hex())
"""


def test_their_protobuf_understands_our_packet_and_we_understand_theirs() -> None:
    _needs("abb_robot_client")
    sample = RobotSample(
        seqno=70_000,
        robot_ms=4_000_000_000,
        joints_deg=(1.5, -2.5, 3.5, -4.5, 5.5, -6.5),
        position_mm=(515.25, -1e-3, 712.0),
        quaternion_wxyz=(0.5, -0.5, 0.5, -0.5),
        external_axes=(10.0, -20.0),
        time_us=1_700_000_000_123_456,
        motors_on=True,
        program_running=True,
    )
    command = [sys.executable, "-c", THEIRS, encode(sample).hex()]
    theirs = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert theirs != encode(sample).hex()
    assert decode(bytes.fromhex(theirs)) == sample
