"""Runs the tasks of an archive: in this process, on Dask workers of this machine, or of a Dask scheduler elsewhere.

Each scan is one task with its own files, so the results do not depend on the number of workers. finished.json in the
target has what two listings said of the files of each finished scan, so that none is read again. It may be deleted:
then, as for a file that has changed, the contents are compared.
"""

import asyncio
import concurrent.futures
import hashlib
import json
import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from daemon.tools.batch_registration.remote_folder import ArchiveError, Listing, RemoteFolder, import_extra
from daemon.tools.batch_registration.tasks import OutcomeDocument, RegistrationTask, outcome_of_failure, run_task
from registration.errors import RegistrationError

Executor = Callable[[Sequence[RegistrationTask]], Iterator[OutcomeDocument]]

HERE, LOCAL = "here", "local"
MAX_CONNECT_S = 15.0

RESUME = "start it, or take --scheduler local, and give the same command again: finished scans are skipped"


@contextmanager
def open_executor(scheduler: str, workers: int) -> Iterator[Executor]:
    """The executor `here`, `local` (`workers` processes) or at an address like tcp://host:8786. Raises ArchiveError."""
    if scheduler == HERE:
        yield run_here
        return
    if scheduler != LOCAL and "://" not in scheduler:
        raise ArchiveError(f"{scheduler!r} is no scheduler", f"use {HERE}, {LOCAL} or an address like tcp://host:8786")
    with _client(scheduler, workers) as client:
        yield lambda tasks: _run_on_dask(client, tasks)


def run_here(tasks: Iterable[RegistrationTask]) -> Iterator[OutcomeDocument]:
    """Run the tasks one after another in this process."""
    yield from map(run_task, tasks)


@contextmanager
def _client(scheduler: str, workers: int) -> Iterator[Any]:
    distributed = import_extra("distributed")
    for name in ("distributed", "distributed.client"):  # what they log is told in an error of ours
        logging.getLogger(name).setLevel(logging.CRITICAL)
    options: dict[str, Any] = {"address": scheduler, "timeout": MAX_CONNECT_S}
    if scheduler == LOCAL:
        options = {"n_workers": workers, "threads_per_worker": 1, "processes": True, "silence_logs": 50,
                   "dashboard_address": "127.0.0.1:0",  # None takes port 8787, with a warning where it is in use
                   "scheduler_kwargs": {"dashboard": False}}  # fmt: skip
    try:
        client = distributed.Client(**options)
    except (OSError, ValueError, TimeoutError) as error:
        fix = "start it with `dask scheduler`, and workers with `dask worker`"
        raise ArchiveError(f"no Dask scheduler answers at {scheduler} ({error})", fix) from None
    with client:
        yield client


def _run_on_dask(client: Any, tasks: Sequence[RegistrationTask]) -> Iterator[OutcomeDocument]:
    """Yield outcomes as they complete. A scan whose workers die fails, after Dask's retries on other workers.

    Raises ArchiveError when the scheduler is gone.
    """
    distributed = import_extra("distributed")
    scans = {client.submit(run_task, task, pure=False): task.scan for task in tasks}
    for future in distributed.as_completed(list(scans)):
        try:
            error = future.exception()
            failed = f"its worker failed ({error}): try it again"
            yield future.result() if error is None else outcome_of_failure(scans[future], failed)
        except (asyncio.CancelledError, concurrent.futures.CancelledError, OSError):  # the connection is closed
            raise ArchiveError("the Dask scheduler is gone", RESUME) from None
        future.release()


FINISHED_NAME = "finished.json"

SAVE_EVERY = 1000
"""Scans after which it is written, which takes a listing; what was finished later is compared by content."""


@dataclass(frozen=True)
class FinishedScans:
    """The finished scans of an archive. `listed`: the source, before anything is read of it."""

    target: RemoteFolder
    listed: Listing

    def run(self, tasks: Sequence[RegistrationTask], execute: Executor) -> Iterator[OutcomeDocument]:
        """Outcomes of the tasks, first those of scans whose files are as they were. Raises ArchiveError, OSError."""
        known: dict[str, OutcomeDocument] = {}
        with suppress(ArchiveError, OSError, RecursionError, TypeError, ValueError, AttributeError):
            rows = json.loads(self.target.read(FINISHED_NAME) or b"{}")
            known = {mark: OutcomeDocument(**row) for mark, row in rows.items()}
        results = self.target.list_marks()
        outcomes = [known[mark] for task in tasks if (mark := self._mark(task, results)) in known]
        yield from outcomes
        done = {outcome.scan for outcome in outcomes}
        try:
            for outcome in execute([task for task in tasks if task.scan not in done]):
                outcomes.append(outcome)
                yield outcome
                if len(outcomes) % SAVE_EVERY == 0:
                    self._save(tasks, outcomes)
        finally:
            if len(outcomes) > len(done):
                self._save(tasks, outcomes)

    def _save(self, tasks: Sequence[RegistrationTask], outcomes: Sequence[OutcomeDocument]) -> None:
        with suppress(ArchiveError, OSError, RegistrationError):  # the results are there; the next run reads them
            results = self.target.list_marks()
            marks = {task.scan: self._mark(task, results) for task in tasks}
            rows = {
                marks[outcome.scan]: outcome.model_copy(update={"state": "unchanged"}).model_dump()
                for outcome in outcomes
                if outcome.state != "failed" and marks[outcome.scan]
            }
            self.target.write(FINISHED_NAME, json.dumps(rows).encode())

    def _mark(self, task: RegistrationTask, results: Listing) -> str:
        """SHA-256 over the options and what the listings say of the files; empty where they say too little."""
        files = [(place, name, mark) for place, listing in enumerate((self.listed, results))
                 for name, mark in sorted(listing.get(task.scan, {}).items()) if name != FINISHED_NAME]  # fmt: skip
        if not all(mark for _, _, mark in files):
            return ""
        return hashlib.sha256(json.dumps([task.scan, task.about.decode(), files]).encode()).hexdigest()
