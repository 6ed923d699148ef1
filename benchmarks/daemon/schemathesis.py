"""Schemathesis with all checks, stateful, against a daemon with fake devices.

`python -m benchmarks.daemon.schemathesis`

Robot, camera and scanner are fakes, everything else is real: server, store on disk, openapi.json. `--cases`: minimum
number of requests; rounds with new seeds follow each other until it is reached, without /keys and /session, which end
the key that all requests have; they have a round of their own at the end. A failure is printed with its request, and
the exit status is 1, as when the key has ended all the same.
"""

import argparse
import asyncio
import multiprocessing
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import httpx

from tests.daemon.api.schemathesis_round import end_streams_soon, one_round

ENDS_KEYS = "^/(keys|session|setup)"


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
        url, key = ready.get(timeout=600)
        headers = {"Authorization": f"Bearer {key}"}
        while cases < options.cases and passed:
            count, passed, text = one_round(
                url, headers, options.examples, options.seed + rounds, folder, more=("--exclude-path-regex", ENDS_KEYS)
            )
            cases, rounds = cases + count, rounds + 1
            print(f"seed {options.seed + rounds - 1}: {count} cases, {cases} so far", flush=True)
            if not passed:
                print(text)
            if httpx.get(f"{url}/audit", headers=headers).status_code != 200:
                print("the key has ended: what came after it had no rights")
                passed = False
        if passed:
            count, passed, text = one_round(
                url, headers, options.examples, options.seed, folder, "examples,fuzzing",
                ("--include-path-regex", ENDS_KEYS),
            )  # fmt: skip
            print(f"/keys and /session: {count} cases", flush=True)
            cases += count
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
