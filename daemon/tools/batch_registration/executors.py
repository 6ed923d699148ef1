"""Who does the work: this process, Dask's workers on this machine, or a Dask scheduler elsewhere.

Each scan is one task and owns its files, so the bytes do not depend on how many workers there are.
"""

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from daemon.tools.batch_registration.errors import ArchiveError
from daemon.tools.batch_registration.remote_folder import library
from daemon.tools.batch_registration.tasks import Outcome, Task, register_one

Engine = Callable[[Sequence[Task]], Iterator[Outcome]]

HERE, LOCAL = "here", "local"
CONNECT_LIMIT_S = 15.0


@contextmanager
def engine(scheduler: str, workers: int) -> Iterator[Engine]:
    """By name: `here`, `local` (with so many workers), or an address like tcp://host:8786. Raises ArchiveError."""
    if scheduler == HERE:
        yield in_this_process
        return
    if scheduler != LOCAL and "://" not in scheduler:
        raise ArchiveError(f"{scheduler!r} is no scheduler", f"use {HERE}, {LOCAL} or an address like tcp://host:8786")
    with _client(scheduler, workers) as client:
        yield lambda tasks: _by_dask(client, tasks)


def in_this_process(tasks: Iterable[Task]) -> Iterator[Outcome]:
    """One after another."""
    yield from map(register_one, tasks)


@contextmanager
def _client(scheduler: str, workers: int) -> Iterator[Any]:
    distributed = library("distributed")
    logging.getLogger("distributed").setLevel(logging.ERROR)
    if scheduler == LOCAL:
        with (
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = distributed.Client(scheduler, timeout=CONNECT_LIMIT_S)
    except (OSError, ValueError, TimeoutError) as error:
        fix = "start it with `dask scheduler`, and workers with `dask worker`"
        raise ArchiveError(f"no Dask scheduler answers at {scheduler} ({error})", fix) from None
    with client:
        yield client


def _by_dask(client: Any, tasks: Sequence[Task]) -> Iterator[Outcome]:
    """As they are done. A worker that dies with a scan costs that scan, after Dask has tried it elsewhere."""
    distributed = library("distributed")
    scans = {client.submit(register_one, task, pure=False): task.scan for task in tasks}
    for future in distributed.as_completed(list(scans)):
        error = future.exception()
        if error is None:
            yield future.result()
        else:
            yield Outcome(scans[future], "failed", accepted=False, error=f"its worker failed ({error}): try it again")
        future.release()
