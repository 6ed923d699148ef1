"""Schemathesis with all its checks, stateful, against a daemon with fake devices.

`python -m benchmarks.daemon.schemathesis`

The robot, the camera and the scanner are the tests' fakes, everything else is what runs in a plant: the server, the
store on a disk, openapi.json. `--cases` is how many requests there shall be at least: rounds with new seeds follow each
other until there were so many. A failure is printed with the request that shows it, and the exit status is 1.
"""

import argparse
import asyncio
import json
import multiprocessing
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
OPENAPI = ROOT / "docs" / "openapi.json"

CONFIG = """
[checks.positive_data_acceptance]
# The schema cannot say everything a request must be: 412 a condition that is not met, 415 a cloud of another kind,
# 422 what only its meaning forbids (a quaternion that is none, a cursor that names nothing, a key used before).
expected-statuses = ["2xx", 304, 401, 403, 404, 406, 409, 412, 413, 415, 422, "5xx"]
[checks.negative_data_rejection]
expected-statuses = [400, 401, 403, 404, 405, 406, 409, 411, 412, 413, 415, 421, 422, 431]
"""


def daemon_process(folder: str, ready: Any) -> None:
    """The daemon with its real server and devices from the tests' fakes."""
    asyncio.run(_daemon(Path(folder), ready))


async def _daemon(folder: Path, ready: Any) -> None:
    from daemon.access.roles import Role
    from daemon.store.actor import AuditContext
    from tests.daemon.api.test_register import with_a_calibration
    from tests.daemon.cell_under_test import serving, settings_for

    async with serving(settings_for(folder, calibration={"manual_wait_s": 1})) as bench:
        await with_a_calibration(bench)
        end_streams_soon(bench.application.events)
        key, _ = await bench.application.key_service.add("schemathesis", Role.ADMIN, AuditContext())
        ready.put((bench.url, key))
        await asyncio.Event().wait()


def end_streams_soon(events: Any) -> None:
    """GET /events never ends by itself, and Schemathesis waits for the end of every answer."""
    listen = events.listen

    async def briefly(after: int, idle_s: float | None = None) -> Any:
        async for event in listen(after, 0.02):
            yield event
            if event is None:
                return

    events.listen = briefly


PHASES = "examples,coverage,fuzzing,stateful"


def one_round(
    url: str, key: str, examples: int, seed: int, folder: Path, phases: str = PHASES, more: tuple[str, ...] = ()
) -> tuple[int, bool, str]:
    """How many cases there were, whether all passed, and what Schemathesis printed."""
    config, report = folder / "schemathesis.toml", folder / "report.ndjson"
    config.write_text(CONFIG)
    command = [
        str(Path(sys.executable).with_name("schemathesis")), "--config-file", str(config), "run", str(OPENAPI),
        "--url", url, "--header", f"Authorization: Bearer {key}", "--checks", "all", "--phases", phases,
        "--max-examples", str(examples), "--seed", str(seed), "--continue-on-failure", "--warnings", "off",
        "--suppress-health-check", "all", "--request-timeout", "120",
        "--max-response-time", "120",  # `wait` is asked for, and a run takes as long as it takes
        "--report", "ndjson", "--report-ndjson-path", str(report), *more,
    ]  # fmt: skip
    process = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
    return _cases(report), process.returncode == 0, process.stdout + process.stderr


def _cases(report: Path) -> int:
    count = 0
    with report.open() as lines:
        for line in lines:
            event = json.loads(line)
            for name, content in event.items():
                if name == "ScenarioFinished":
                    count += len(content.get("recorder", {}).get("cases", {}))
    return count


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
            count, passed, text = one_round(url, key, options.examples, options.seed + rounds, folder)
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
