"""An update holds the daemon: no run begins, the one in progress goes on, and systemd has the line that says so."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from daemon.runtime.clock import Clock
from daemon.runtime.systemd import MAX_SILENT_S, Doing, Systemd, UpdateHold
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.runtime.service_manager import Manager


@dataclass
class Time:
    now_s: float = 0.0

    def clock(self) -> Clock:
        return replace(Clock(), monotonic_s=lambda: self.now_s)


def test_a_hold_lasts_while_it_is_touched_whatever_the_clock_of_the_day_says(tmp_path: Path) -> None:
    file, time = tmp_path / "hold", Time()
    hold = UpdateHold(time.clock(), file)
    hold.look()
    assert hold.reason is None
    file.write_text("release 0.2.0\n")
    os.utime(file, (1, 1))  # decades ago, by this clock
    hold.look()
    assert hold.reason == "release 0.2.0"
    time.now_s += MAX_SILENT_S - 1
    os.utime(file, (2, 2))
    hold.look()
    time.now_s += MAX_SILENT_S - 1
    hold.look()
    assert hold.reason == "release 0.2.0"
    time.now_s += 2  # whoever touched it has died
    hold.look()
    assert hold.reason is None
    os.utime(file, (3, 3))
    hold.look()
    assert hold.warnings() == ["nothing begins now: release 0.2.0 is being installed"]
    file.unlink()
    hold.look()
    assert hold.warnings() == []


@pytest.mark.parametrize(
    ("doing", "line"),
    [
        (Doing("", None, ()), "up, no run in progress"),
        (Doing("", None, ("a",)), "up, no run in progress; a"),
        (Doing("", None, ("a", "b", "c")), "up, no run in progress; a (and 2 more warnings: /ready)"),
        (Doing("run 7 (calibrate)", None, ()), "run 7 (calibrate) is in progress"),
        (Doing("", "release 2", ("a",)), "held, free for release 2"),
        (Doing("run 7 (scan)", "release 2", ()), "held, run 7 (scan) is in progress: release 2 waits for its end"),
    ],
)
def test_the_line_says_what_counts_most(doing: Doing, line: str) -> None:
    assert doing.line() == line


async def test_no_run_begins_while_an_update_holds_the_daemon(tmp_path: Path) -> None:
    manager, hold = Manager(f"{tmp_path}/notify"), tmp_path / "hold"
    systemd = Systemd(f"{tmp_path}/notify", None, hold)
    async with serving(settings_for(tmp_path / "store"), systemd=systemd) as bench:
        started = await bench.client.post("/calibrate")
        assert started.status_code == 202
        hold.write_text("release 0.2.0\n")
        line = ""
        while not line.startswith("STATUS=held, free"):
            line = await manager.hears()  # the run that goes on is waited for
        assert (await bench.client.get(started.headers["location"])).json()["state"] == "finished"
        refused = await bench.client.post("/calibrate")
        assert (refused.status_code, refused.json()["code"]) == (503, "stopping")
        assert refused.json()["detail"] == "nothing begins now: release 0.2.0 is being installed"
        ready = (await bench.client.get("/ready")).json()
        assert ready["calibrate"]["reasons"] == ready["warnings"] == [refused.json()["detail"]]
        hold.unlink()
        while line != "STATUS=up, no run in progress":
            line = await manager.hears()
        assert (await bench.client.post("/calibrate")).status_code == 202
    manager.socket.close()
