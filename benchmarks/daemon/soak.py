"""Two hours of a busy cell, compressed: 10,000 registrations in N minutes.

`python -m benchmarks.daemon.soak --minutes N`

A mock cell and the daemon as processes; clouds are registered without a pause; meanwhile the cell is verified, polled
as by an MES, Prometheus and a web page, and read and written by a PLC. Memory and descriptors of the daemon are read
from /proc. Both slopes are fitted to the samples after the first quarter.
"""

import argparse
import socket
import struct
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text
from protocols.modbus.mbap import Adu

REGISTRATIONS = 10_000
AN_HOUR = 5_000
"""Registrations per hour of a busy cell."""

POINTS = 5_000
WARM_UP = 0.25
RUNS_OF_A_PAGE = 20
POSE = "800,100,900,0,0.7071068,0.7071068,0"
LIMITS = {"memory": 1.0, "descriptors": 0.5}
"""MB per compressed hour; descriptors per hour. Not judged in less than one such hour, while memory still grows."""


@dataclass
class Record:
    """Actions and samples of a run."""

    registrations: int = 0
    verifications: int = 0
    failures: list[str] = field(default_factory=list)
    samples: list[tuple[float, float, int, float]] = field(default_factory=list)
    """Fraction done, MB resident, descriptors, seconds."""

    def slope(self, column: int) -> tuple[float, float]:
        """Slope of a column over the whole run, and its standard error."""
        steady = np.array([sample for sample in self.samples if sample[0] >= WARM_UP])
        if len(steady) < 3:
            return float("nan"), float("nan")
        (slope, _), covariance = np.polyfit(steady[:, 0], steady[:, column], 1, cov=True)
        return float(slope), float(np.sqrt(covariance[0, 0]))


class Cell:
    """The daemon with its clients."""

    def __init__(self, url: str, pid: int, plc_port: int) -> None:
        self.http = httpx.Client(base_url=url, timeout=120, trust_env=False)
        self._proc = Path("/proc") / str(pid)
        self._plc_port = plc_port
        self._plc: socket.socket | None = None
        self.cloud = _cloud()

    def register(self) -> None:
        answer = self.http.post(
            "/register", params={"pose": POSE}, content=self.cloud, headers={"content-type": "application/x-ply"}
        )
        answer.raise_for_status()
        assert len(answer.content) >= POINTS * 12

    def look(self) -> None:
        for path in (
            "/ready",
            "/metrics",
            f"/runs?limit={RUNS_OF_A_PAGE}",
            "/calibrations/current",
            "/camera/frame.png",
        ):
            self.http.get(path).raise_for_status()

    def listen(self) -> None:
        """Open and close an event stream."""
        with self.http.stream("GET", "/events", headers={"last-event-id": "0"}) as events:
            next(events.iter_lines())

    def run(self, path: str) -> dict[str, Any]:
        answer = self.http.post(path, params={"wait": 120})
        answer.raise_for_status()
        found: dict[str, Any] = answer.json()
        return found

    def plc_cycle(self, beat: int) -> None:
        """Write the heartbeat, then read status and result."""
        if self._plc is None:
            self._plc = socket.create_connection(("127.0.0.1", self._plc_port), timeout=30)
        sent = (
            struct.pack(">BHH", 6, 1, beat & 0xFFFF),
            struct.pack(">BHH", 4, 16, 20),
            struct.pack(">BHH", 4, 64, 84),
        )
        self._plc.sendall(b"".join(Adu(number, 1, pdu).encode() for number, pdu in enumerate(sent)))
        wanted = (7 + 5) + (7 + 2 + 40) + (7 + 2 + 168)
        while wanted > 0:
            data = self._plc.recv(4096)
            assert data, "the PLC was cut off"
            wanted -= len(data)

    def plc_leaves(self) -> None:
        if self._plc is not None:
            self._plc.close()
            self._plc = None

    def resident_mb(self) -> float:
        pages = int((self._proc / "statm").read_text().split()[1])
        return pages * 4096 / 1e6

    def descriptors(self) -> int:
        return sum(1 for _ in (self._proc / "fd").iterdir())

    def close(self) -> None:
        self.plc_leaves()
        self.http.close()


def fill(cell: Cell) -> None:
    """Fill what grows by design before measuring: the page of the last runs, kept events, caches."""
    for _ in range(RUNS_OF_A_PAGE):
        cell.run("/verify")
        cell.look()


def soak(cell: Cell, minutes: float, registrations: int) -> Record:
    """Run everything, paced to take `minutes`."""
    record, began_s = Record(), time.monotonic()
    pause_s = 60 * minutes / registrations
    while record.registrations < registrations and time.monotonic() - began_s < 60 * minutes * 1.5:
        number = record.registrations
        try:
            _work(cell, number, record)
        except (httpx.HTTPError, AssertionError, OSError) as error:
            record.failures.append(f"registration {number}: {type(error).__name__}: {error}")
            cell.plc_leaves()
        record.registrations += 1
        if number % max(registrations // 400, 1) == 0:
            share = record.registrations / registrations
            record.samples.append((share, cell.resident_mb(), cell.descriptors(), time.monotonic() - began_s))
        time.sleep(max(0.0, began_s + (number + 1) * pause_s - time.monotonic()))
    return record


def _work(cell: Cell, number: int, record: Record) -> None:
    cell.register()
    cell.plc_cycle(number)
    if number % 100 == 50:
        cell.plc_leaves()
    if number % 20 == 10:
        cell.look()
    if number % 50 == 25:
        cell.listen()
    if number % 500 == 250:
        run = cell.run("/verify")
        record.verifications += 1
        if run["state"] != "finished":
            record.failures.append(f"verification {run['id']}: {run['cause']}")


def _cloud() -> bytes:
    points = np.random.default_rng(0).normal([0, 0, 500], 50, (POINTS, 3)).astype("<f4")
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {POINTS}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    return header.encode() + points.tobytes()


@contextmanager
def busy_cell() -> Iterator[Cell]:
    """Mock cell and daemon, calibrated."""
    with tempfile.TemporaryDirectory(prefix="handeyed-soak-") as name, socket.create_server(("127.0.0.1", 0)) as free:
        folder, plc_port = Path(name), free.getsockname()[1]
        free.close()
        mock = ["mock_robot", "run", "--with-parent", "--seed", "7", "--time-scale", "200"]
        with start_child("mock-cell", mock, folder) as robot:
            settings = folder / "handeyed.toml"
            plc = f'[plc]\nport = {plc_port}\nwriters = ["127.0.0.1"]\n'
            settings.write_text(settings_text(robot.announcement, 0) + plc)
            with start_child("daemon", ["daemon.cli", "serve", str(settings)], folder) as daemon:
                cell = Cell(daemon.announcement["url"], daemon.announcement["pid"], plc_port)
                try:
                    run = cell.run("/calibrate")
                    assert run["result"] and run["result"]["applied"], run["cause"]
                    yield cell
                finally:
                    cell.close()


def report(record: Record, minutes: float) -> bool:
    """Print the result; returns whether it is within the limits."""
    hours = record.registrations / AN_HOUR
    memory, memory_error = (value / hours for value in record.slope(1))
    descriptors, _ = (value / hours for value in record.slope(2))
    resident = [sample[1] for sample in record.samples if sample[0] >= WARM_UP] or [float("nan")]
    open_ = [sample[2] for sample in record.samples if sample[0] >= WARM_UP] or [0]
    print(f"{record.registrations:,} registrations, {record.verifications} verifications in {minutes:.1f} minutes:"
          f" {hours:.2g} hours, compressed")  # fmt: skip
    print(f"failures              {len(record.failures)}")
    for failure in record.failures[:5]:
        print(f"  {failure}")
    print(f"memory                {resident[0]:.1f} MB, at the end {resident[-1]:.1f} MB, most {max(resident):.1f} MB")
    print(f"memory slope          {memory:+.2f} ± {memory_error:.2f} MB a compressed hour (limit {LIMITS['memory']:g})")
    print(f"descriptors           {open_[0]}, at the end {open_[-1]}, {min(open_)} to {max(open_)}")
    print(f"descriptor slope      {descriptors:+.2f} a compressed hour (limit {LIMITS['descriptors']:g})")
    if hours < 1:
        print("too short to judge the slopes by: --minutes 10 is the least")
        return not record.failures
    return not record.failures and memory < LIMITS["memory"] and descriptors < LIMITS["descriptors"]


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.daemon.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--registrations", type=int, default=None, help="default: 10,000, less below 20 minutes")
    options = parser.parse_args()
    registrations = options.registrations or min(REGISTRATIONS, max(200, int(options.minutes * 500)))
    with busy_cell() as cell:
        fill(cell)
        began_s = time.monotonic()
        record = soak(cell, options.minutes, registrations)
        took_min = (time.monotonic() - began_s) / 60
    return 0 if report(record, took_min) else 1


if __name__ == "__main__":
    sys.exit(main())
