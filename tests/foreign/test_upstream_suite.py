"""The tests that abb_robot_client brings along, unmodified but for the controller's address, at the mock.

They need a clone of rpiRobotics/abb_robot_client, which HANDEYED_ABB_ROBOT_CLIENT names, and UDP port 6510.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.support.waiting import eventually_blocking

pytest.importorskip("abb_robot_client.rws", reason="abb-robot-client is not installed")
CLONE = os.environ.get("HANDEYED_ABB_ROBOT_CLIENT", "")
SIO = """SIO:CFG_1.0:6:1::
#
COM_TRP:

      -Name "UCdevice" -Type "UDPUC" -RemoteAdress "127.0.0.1" -RemotePortNumber 6510
"""
TWICE_AS_FAST = ("--time-scale", "2")
"""Its test of guidance by poses wants an arm that has come to where guidance begins within 0.7 s."""


@pytest.mark.slow
@pytest.mark.skipif(not CLONE, reason="HANDEYED_ABB_ROBOT_CLIENT names no clone of rpiRobotics/abb_robot_client")
def test_every_test_of_upstream_passes(tmp_path: Path) -> None:
    suite = Path(shutil.copytree(Path(CLONE) / "test", tmp_path / "test"))
    (suite / "rapid" / "SIO.cfg").write_text(SIO, "ascii")
    ready, tests = tmp_path / "ready.json", suite / "test_abb_robot_client.py"
    command = [sys.executable, "-m", "mock_robot", "run", "--robot-only", "--home", str(suite / "rapid")]
    with subprocess.Popen([*command, *TWICE_AS_FAST, "--ready-file", str(ready)], cwd=ROOT) as mock:
        try:
            eventually_blocking(lambda: ready.exists() and bool(ready.read_text("utf-8")))
            address = json.loads(ready.read_text("utf-8"))["rws"]["1.0"]
            tests.write_text(tests.read_text("utf-8").replace('"http://localhost:80"', f'"{address}"'), "utf-8")
            pytest_there = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(suite)]
            ran = subprocess.run([*pytest_there, tests], check=False, capture_output=True, text=True)
        finally:
            mock.terminate()
    assert "11 passed" in ran.stdout, ran.stdout
