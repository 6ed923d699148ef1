"""Where the time of a calibration run goes: `python -m benchmarks.run_time [--runs 3] [--tolerance-mm 0.5]`.

Runs of eight planned poses, or until U meets a tolerance, with the daemon and the mock cell on real sockets, the arm in
real time. The elapsed time is that between the run's events, by the state that it leaves. Moving, settling and the
exposure are the cell's; the rest is the daemon's, as a share of the cell's.
"""

import argparse
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text
from handeyed.client import Client, ServerEvent

POSES, BAR = 8, 0.05
OF_THE_CELL = ("moving", "settling", "capturing")


def state_times_s(url: str, tolerance_mm: float | None) -> tuple[dict[str, float], float]:
    """Elapsed seconds of one run, by state, and its U in mm. Exits when the run fails."""
    times: dict[str, float] = defaultdict(float)
    state, since_s = "starting", time.monotonic()

    def follow(event: ServerEvent) -> None:
        nonlocal state, since_s
        now_s = time.monotonic()
        times[state] += now_s - since_s
        state, since_s = event["state"], now_s

    with Client(url) as daemon:
        asked = {"count": POSES} if tolerance_mm is None else {"tolerance_mm": tolerance_mm}
        run = daemon.follow("/calibrate", asked, follow)
    if run["state"] != "finished":
        raise SystemExit(f"the run {run['state']}: {run['cause']}")
    return dict(times), run["result"]["expanded_mm"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--time-scale", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--tolerance-mm", type=float, help=f"end by this U, in place of {POSES} poses")
    given = parser.parse_args()
    mock = ["mock_robot", "run", "--with-parent", "--seed", str(given.seed), "--time-scale", str(given.time_scale)]
    with tempfile.TemporaryDirectory() as temporary, start_child("mock-cell", mock, Path(temporary)) as cell:
        settings = Path(temporary) / "handeyed.toml"
        settings.write_text(settings_text(cell.announcement, 0))
        with start_child("daemon", ["daemon.cli", "serve", str(settings)], Path(temporary)) as daemon:
            url = daemon.announcement["url"]
            found = [state_times_s(url, given.tolerance_mm) for _ in range(given.runs)]
    runs = [times for times, _ in found]
    states = list(dict.fromkeys(state for run in runs for state in run))
    for state in states:
        print(f"{state:12} {statistics.median(run.get(state, 0.0) for run in runs):6.2f} s")
    shares = []
    for run, expanded_mm in found:
        cell_s = sum(run.get(state, 0.0) for state in OF_THE_CELL)
        shares.append((sum(run.values()) - cell_s) / cell_s)
        added = f"the daemon adds {100 * shares[-1]:.1f} % (bar {100 * BAR:.0f} %)"
        print(f"run of {sum(run.values()):6.2f} s to U of {expanded_mm:.3f} mm: {added}")
    return int(statistics.median(shares) > BAR)


if __name__ == "__main__":
    sys.exit(main())
