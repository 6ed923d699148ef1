"""One round of Schemathesis against a running daemon."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from daemon.api.live.live_feed import LiveFeed
from daemon.api.live.picture_stream import PictureStream

ROOT = Path(__file__).resolve().parents[3]

OPENAPI = ROOT / "docs" / "openapi.json"

CONFIG = """
[checks.positive_data_acceptance]
# The schema cannot say everything a request must be: 412 a condition that is not met, 415 a cloud of another kind,
# 422 what only its meaning forbids (a quaternion that is none, a cursor that names nothing, a key used before).
expected-statuses = ["2xx", 304, 401, 403, 404, 406, 409, 412, 413, 415, 422, 429, "5xx"]
[checks.negative_data_rejection]
expected-statuses = [400, 401, 403, 404, 405, 406, 409, 411, 412, 413, 415, 421, 422, 429, 431]
"""


def end_streams_soon(events: Any) -> None:
    """GET /events never ends by itself, and Schemathesis waits for the end of every answer."""
    listen = events.listen

    async def briefly(after: int, idle_s: float | None = None) -> Any:
        async for event in listen(after, 0.02):
            yield event
            if event is None:
                return

    events.listen = briefly
    LiveFeed.messages = _first_message  # type: ignore[method-assign]
    PictureStream.parts = _first_part  # type: ignore[method-assign]


async def _first_message(self: LiveFeed, listener: Any) -> Any:
    """GET /live, which ends with its first message."""
    async for message in _MESSAGES(self, listener):
        yield message
        return


async def _first_part(self: PictureStream, width: int) -> Any:
    """GET /camera/stream, which ends with its first picture."""
    yield b"".join([await anext(parts) for parts in [_PARTS(self, width)] for _ in range(2)])


_MESSAGES, _PARTS = LiveFeed.messages, PictureStream.parts


PHASES = "examples,coverage,fuzzing,stateful"


def one_round(
    url: str,
    headers: dict[str, str],
    examples: int,
    seed: int,
    folder: Path,
    phases: str = PHASES,
    more: tuple[str, ...] = (),
) -> tuple[int, bool, str]:
    """How many cases there were, whether all passed, and what Schemathesis printed."""
    config, report = folder / "schemathesis.toml", folder / "report.ndjson"
    config.write_text(CONFIG)
    given = [part for name, value in headers.items() for part in ("--header", f"{name}: {value}")]
    command = [
        str(Path(sys.executable).with_name("schemathesis")), "--config-file", str(config), "run", str(OPENAPI),
        "--url", url, *given, "--checks", "all", "--phases", phases,
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
