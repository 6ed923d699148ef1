"""A hang leaves a trace: the stacks of threads and tasks before the watchdog's end, and the cause of the last end."""

import asyncio
import queue
import threading
from datetime import UTC, datetime
from pathlib import Path

import pytest

from daemon.runtime.systemd import ENDS, RECENT_S, HangReport, ServiceEnd, ServiceEnds, read_ends, stacks


def wait_here_for(released: threading.Event) -> None:
    released.wait()


async def sleeping_task(released: asyncio.Event) -> None:
    await released.wait()


async def test_the_report_has_the_stacks_of_threads_and_tasks() -> None:
    released, woken = threading.Event(), asyncio.Event()
    thread = threading.Thread(target=wait_here_for, args=(released,), name="the hung worker")
    thread.start()
    task = asyncio.create_task(sleeping_task(woken), name="the sleeping task")
    await asyncio.sleep(0)
    try:
        text = "\n".join(await asyncio.to_thread(stacks, asyncio.get_running_loop(), 24.0))
    finally:
        released.set()
        woken.set()
        thread.join()
        await task
    assert text.startswith("nothing has gone on for 24 s")
    assert "thread the hung worker:" in text
    assert "in wait_here_for" in text
    assert "task the sleeping task:" in text
    assert "in sleeping_task" in text


async def test_a_loop_that_hangs_is_reported_once_and_again_after_it_went_on() -> None:
    lines: queue.Queue[str] = queue.Queue()
    report = HangReport(0.05, lines.put)
    report.start()
    try:
        assert lines.get(timeout=60).startswith("nothing has gone on")  # the loop stands here meanwhile
        report.note()
        while not lines.get(timeout=60).startswith("nothing has gone on"):
            pass  # the rest of the first report
    finally:
        report.stop()


async def test_nothing_is_reported_while_the_work_is_alive() -> None:
    lines: queue.Queue[str] = queue.Queue()
    report = HangReport(3600.0, lines.put)
    report.start()
    report.note()
    report.stop()
    assert lines.empty()


@pytest.mark.parametrize(
    ("line", "cause"),
    [
        ("1795680000 watchdog dumped ABRT", "watchdog"),
        ("1795680000 signal killed KILL", "signal KILL"),
        ("1795680000 core-dump dumped SEGV", "signal SEGV"),
        ("1795680000 oom-kill killed KILL", "oom-kill"),
        ("1795680000 exit-code exited 1", "exit status 1"),
        ("1795680000 success exited 0", None),  # somebody stopped it
        ("1795680000 success killed TERM", None),
        ("", None),
        ("nonsense", None),
    ],
)
def test_ends_are_read_as_systemd_names_them(tmp_path: Path, line: str, cause: str | None) -> None:
    (tmp_path / ENDS).write_text(f"{line}\n")
    expected = () if cause is None else (ServiceEnd(1795680000.0, cause),)
    assert read_ends(tmp_path) == expected


def test_the_last_end_is_warned_of_for_a_day_and_counted_on() -> None:
    at_s = datetime(2026, 11, 26, 8, 0, tzinfo=UTC).timestamp()
    ends = (ServiceEnd(at_s - 60, "signal KILL"), ServiceEnd(at_s, "watchdog"))
    (warning,) = ServiceEnds(ends, lambda: at_s + RECENT_S - 1).warnings()
    assert "2 times by itself, last after watchdog at 2026-11-26 08:00:00 UTC" in warning
    later = ServiceEnds(ends, lambda: at_s + RECENT_S + 1)
    assert later.warnings() == []
    (metric,) = later.families()
    assert metric.samples == {(("cause", "signal KILL"),): 1.0, (("cause", "watchdog"),): 1.0}


def test_a_daemon_that_is_no_service_has_no_ends(tmp_path: Path) -> None:
    assert read_ends(None) == read_ends(tmp_path) == ()
    (metric,) = ServiceEnds(()).families()
    assert sum(metric.samples.values()) == 0
