"""Cuts the power below the file system, after every call that changes the disk, while everything is saved.

`python -m benchmarks.daemon.power_cut`

strace records every call of a process that saves a run, an image, a calibration, what is applied, a scan, a view,
events, audit rows, keys, sessions, requests, webhooks, documents and the anchor, closes the store, backs it up,
restores the backup and migrates an older store. After each of these calls the disk may hold anything between what was
last synchronised (fsync of the file, and of its folder) and all that was written: each later write kept, dropped, or
torn by sector; each later name given, taken away, or not. The store is started on such states: what was acknowledged is
there, everything else completely or not at all.
"""

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.daemon.power_cut.cuts import Cuts, cut_everywhere, record


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="cut after every so manieth call only")
    parser.add_argument("--states", type=int, default=40, help="random states for each cut, beside the four extremes")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if shutil.which("strace") is None:
        print("strace is not installed: apt install strace")
        return 1
    began_s, cuts, shown = time.monotonic(), Cuts(), 0
    with tempfile.TemporaryDirectory(prefix="handeyed-power-") as folder:
        root, calls = record(Path(folder))
        for cuts in cut_everywhere(root, calls, every=options.every, random_states=options.states, seed=options.seed):
            for loss in cuts.losses[shown:]:
                print(loss, flush=True)
            shown = len(cuts.losses)
    print(
        f"{cuts.points} cuts, {cuts.states} different states, {shown} with a loss; {time.monotonic() - began_s:.0f} s"
    )
    return 1 if shown else 0


if __name__ == "__main__":
    sys.exit(main())
