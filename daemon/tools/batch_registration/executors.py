"""Executors of the tasks: this process, Dask workers on this machine, or a Dask scheduler elsewhere.

Each scan is one task with its own files, so the results do not depend on the number of workers.
"""

import asyncio
import concurrent.futures
import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from daemon.tools.batch_registration.errors import ArchiveError
from daemon.tools.batch_registration.remote_folder import import_extra
from daemon.tools.batch_registration.tasks import OutcomeDocument, RegistrationTask, outcome_of_failure, run_task

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
