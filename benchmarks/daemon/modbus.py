"""Fuzzed Modbus TCP frames against the PLC's server, over real sockets.

`python -m benchmarks.daemon.modbus --frames 1000000`
"""

import argparse
import sys

import uvloop

from tests.extensions.plc.modbus_fuzz import fuzz


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.daemon.modbus", description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    tally = uvloop.run(fuzz(options.frames, options.seed))  # as the daemon runs
    print(tally.table())
    return 0 if tally.clean and not tally.closed_late else 1


if __name__ == "__main__":
    sys.exit(main())
