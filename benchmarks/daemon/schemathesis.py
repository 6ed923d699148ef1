"""Schemathesis with all checks, stateful, against a daemon with fake devices.

`python -m benchmarks.daemon.schemathesis`

Robot, camera and scanner are fakes, everything else is real: server, store on disk, openapi.json. `--cases`: minimum
number of requests; rounds with new seeds follow each other until it is reached. A failure is printed with its request,
and the exit status is 1.
"""

import argparse
import asyncio
import multiprocessing
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from tests.daemon.api.schemathesis_round import end_streams_soon, one_round


def daemon_process(folder: str, ready: Any) -> None:
    """The daemon with its real server and fake devices."""
    asyncio.run(_daemon(Path(folder), ready))


async def _daemon(folder: Path, ready: Any) -> None:
    from daemon.access.roles import Role
    from daemon.store.actor import AuditContext
    from tests.daemon.calibrations import apply_calibration
    from tests.daemon.cell_under_test import serving, settings_for

    async with serving(settings_for(folder, calibration={"manual_wait_s": 1})) as bench:
        await apply_calibration(bench)
        end_streams_soon(bench.application.events)
        key, _ = await bench.application.key_service.add("schemathesis", Role.ADMIN, AuditContext())
        ready.put((bench.url, key))
        await asyncio.Event().wait()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2_000)
    parser.add_argument("--examples", type=int, default=40, help="of each operation, in a round")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="handeyed-schemathesis-"))
    context = multiprocessing.get_context("spawn")
    ready = context.Queue()
    child = context.Process(target=daemon_process, args=(str(folder / "store"), ready), daemon=True)
    child.start()
    cases, rounds, passed = 0, 0, True
    try:
        url, key = ready.get(timeout=60)
        while cases < options.cases and passed:
            count, passed, text = one_round(
                url, {"Authorization": f"Bearer {key}"}, options.examples, options.seed + rounds, folder
            )
            cases, rounds = cases + count, rounds + 1
            print(f"seed {options.seed + rounds - 1}: {count} cases, {cases} so far", flush=True)
            if not passed:
                print(text)
    finally:
        child.kill()
        child.join()
        shutil.rmtree(folder, ignore_errors=True)
    print(f"{cases} cases in {rounds} rounds, all checks, stateful: {'no failure' if passed else 'FAILED'}")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
