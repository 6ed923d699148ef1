"""One line a record, with run, request and journald's priority."""

import io
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from daemon.runtime.logs import OneLineFormatter, about_request, about_run, log_to_stdout, priority
from tests.daemon.cell_under_test import serving, settings_for

LINE = re.compile(r"^(?P<level>[A-Z]+) run=(?P<run>\S+) request=(?P<request>\S+) (?P<logger>[\w.]+): (?P<message>.*)$")

SECRET = "c0ffee" * 10 + "4711"
KEY = f"hek_1a2b3c4d_{SECRET}"


def a_record(level: int = logging.INFO, message: str = "something") -> logging.LogRecord:
    return logging.LogRecord("daemon.x", level, "x.py", 1, message, None, None)


@pytest.mark.parametrize(
    ("level", "number"),
    [(logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (logging.DEBUG, 7), (5, 7)],
)
def test_priorities_are_syslogs(level: int, number: int) -> None:
    assert priority(level) == number
    assert OneLineFormatter(priorities=True).format(a_record(level)).startswith(f"<{number}>")
    assert not OneLineFormatter().format(a_record(level)).startswith("<")


def test_a_record_with_a_traceback_and_control_characters_is_one_line_with_both_ids() -> None:
    try:
        raise ValueError("bad\r\nvalue \x1b[2J")
    except ValueError as error:
        record = a_record(logging.ERROR, "a defect\n<0>forged")
        record.exc_info = (type(error), error, error.__traceback__)
    with about_request("mes-7"), about_run("r1"):
        line = OneLineFormatter(priorities=True).format(record)
    assert len(line.splitlines()) == 1
    assert line.startswith("<3>ERROR run=r1 request=mes-7 daemon.x: a defect\\n<0>forged")
    assert "\\nTraceback" in line
    assert "\x1b" not in line
    assert " request=- " in OneLineFormatter().format(record)


@pytest.mark.parametrize("key", [KEY, KEY[:-20], KEY.replace("_", "%5f"), KEY.upper()])
def test_no_api_key_is_logged_wherever_it_stands(key: str) -> None:
    record = a_record(message=f"GET /{key}/x?k={key}.png from 'x{key}x' is refused")
    record.args = ()
    try:
        raise ValueError(key)
    except ValueError as error:
        record.exc_info = (type(error), error, error.__traceback__)
    with about_request(key):
        line = OneLineFormatter().format(record)
    assert SECRET[:20].lower() not in line.lower()
    assert "GET /hek_" in line
    assert "/x?k=" in line


def test_journald_gets_priorities_and_a_terminal_does_not(capsys: pytest.CaptureFixture[str]) -> None:
    root = logging.getLogger()
    before, level = root.handlers[:], root.level
    libraries = {name: logging.getLogger(name).level for name in ("httpx", "pymodbus.logging")}
    try:
        for environment, start in (({"JOURNAL_STREAM": "8:1"}, "<4>WARNING"), ({}, "WARNING")):
            log_to_stdout(environment=environment)
            logging.getLogger("daemon.test").warning("a word")
            assert capsys.readouterr().out.startswith(start)
    finally:
        root.handlers[:], root.level = before, level
        for name, was in libraries.items():
            logging.getLogger(name).setLevel(was)


@contextmanager
def attached(handler: logging.Handler) -> Iterator[None]:
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)


async def test_a_run_carries_the_id_of_the_request_that_started_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    out = io.StringIO()
    handler = logging.StreamHandler(out)
    handler.setFormatter(OneLineFormatter())
    with caplog.at_level(logging.INFO), attached(handler):
        async with serving(settings_for(tmp_path)) as bench:
            answer = await bench.client.post("/calibrate", headers={"x-request-id": "mes-4711"})
            assert answer.headers["x-request-id"] == "mes-4711"
            run = await bench.run_over(answer.headers["location"])
            other = await bench.client.get("/health", headers={"x-request-id": "two words"})
            assert re.fullmatch(r"[0-9a-f]{8}", other.headers["x-request-id"])
    lines = [LINE.match(line) for line in out.getvalue().splitlines()]
    assert all(lines)
    of_the_run = [line for line in lines if line and line["run"] == run["id"]]
    assert len(of_the_run) >= 10
    assert {line["request"] for line in of_the_run} == {"mes-4711"}
