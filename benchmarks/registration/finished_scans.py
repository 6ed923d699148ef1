"""What an archive costs whose scans are finished, and its index: `python -m benchmarks.registration.finished_scans`.

Small scans are registered in this process, as `register-archive` does; every manifest is its own. Scans and results are
then put into the memory of an S3 server (moto, a process of its own) without requests, and `finished.json` is written
by what a run ends with. Reported: time, processor time of this process and requests, of the same command again and of
deploy/fleet/index_archive.py, on the disk and in S3. moto looks at every object for each page of a listing.
"""

import argparse
import importlib.util
import json
import logging
import multiprocessing
import os
import runpy
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmarks.registration.archive import an_archive
from benchmarks.registration.rows import cost
from daemon.tools.batch_registration.archive_run import FINISHED_NAME, FinishedScans, run_here
from daemon.tools.batch_registration.remote_folder import RemoteFolder
from daemon.tools.batch_registration.tasks import OutcomeDocument, RegistrationTask
from tests.daemon.calibrations import a_calibration
from tests.daemon.cli.running import handeyed

BUCKET = "archive"
INDEX = Path(__file__).parents[2] / "deploy" / "fleet" / "index_archive.py"


def serve_s3(folder: Path, ready: Connection) -> None:
    """An S3 server whose bucket holds the files below the folder, until it is terminated."""
    from moto.s3.models import s3_backends
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    backend = s3_backends["123456789012"]["aws"]
    backend.create_bucket(BUCKET, "us-east-1")
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name != FINISHED_NAME:
            backend.put_object(BUCKET, file.relative_to(folder).as_posix(), file.read_bytes())
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    ready.send(server.get_host_and_port())
    server._thread.join()


@contextmanager
def s3_with(folder: Path) -> Iterator[str]:
    """The URL of a bucket with the folder's files."""
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=serve_s3, args=(folder, theirs), daemon=True)
    process.start()
    try:
        host, port = ours.recv()
        os.environ |= {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_ACCESS_KEY_ID": "cell",
            "AWS_SECRET_ACCESS_KEY": "secret",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
        yield f"s3://{BUCKET}"
    finally:
        process.kill()
        process.join()


def counted() -> Counter[str]:
    """Requests to S3 by their names, from now on."""
    from aiobotocore.client import AioBaseClient

    ask, asked = AioBaseClient._make_api_call, Counter[str]()

    async def count(self: Any, name: str, parameters: Any) -> Any:
        asked[name] += 1
        return await ask(self, name, parameters)

    AioBaseClient._make_api_call = count
    return asked


def write_finished(place: str, tasks: Sequence[RegistrationTask], outcomes: Sequence[OutcomeDocument]) -> None:
    """finished.json, as a run writes it that has just had these outcomes."""
    source, target = RemoteFolder.from_url(f"{place}/in"), RemoteFolder.from_url(f"{place}/out")
    moved = [RegistrationTask(source.url, target.url, task.scan, task.calibration) for task in tasks]
    assert len(list(FinishedScans(target, source.list_marks()).run(moved, lambda _: iter(outcomes)))) == len(tasks)


def skip_and_index(place: str, scans: int, calibration: Path, asked: Counter[str]) -> None:
    """Print what the same command costs when all is finished, and the index."""
    command = ("register-archive", f"{place}/in", "--calibration", calibration, "--out", f"{place}/out")
    index_archive = runpy.run_path(str(INDEX))["index_archive"]

    def skip() -> None:
        ran = handeyed(*command, "--scheduler", "here", "--json")
        assert [json.loads(line)["state"] for line in ran.out.splitlines()] == ["unchanged"] * scans

    def index() -> None:
        assert index_archive(f"{place}/out") == (scans, [])

    for what, work in (("all are found finished", skip), ("outcomes.parquet is written", index)):
        RemoteFolder(place)._system()[0].invalidate_cache()  # each is a process of its own elsewhere
        asked.clear()
        spent = cost(work)
        requests = ", ".join(f"{count:,} {name}" for name, count in asked.most_common())
        where = "S3" if "://" in place else "disk"
        print(f"{where:<6}{what:<30}{spent.wall_s:9.1f} s{spent.cpu_s:9.1f} s CPU   {requests}", flush=True)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=10_000)
    parser.add_argument("--points", type=int, default=20)
    options = parser.parse_args()
    if any(importlib.util.find_spec(name) is None for name in ("moto", "s3fs", "pyarrow")):
        print("moto, s3fs and pyarrow are needed: install handeyed[archive,parquet,s3] and moto[server]")
        return
    with tempfile.TemporaryDirectory(prefix="handeyed-bench-") as temporary:
        folder = Path(temporary)
        calibration = folder / "calibration.json"
        calibration.write_text(a_calibration("benchmark").model_dump_json())
        place, outcomes = str(folder / "archive"), []
        names = an_archive(folder / "archive" / "in", options.scans, options.points)
        tasks = [RegistrationTask(f"{place}/in", f"{place}/out", name, calibration.read_text()) for name in names]
        spent = cost(lambda: outcomes.extend(run_here(tasks)))
        print(f"{options.scans} scans of three views of {options.points} points: registered in {spent.wall_s:.1f} s, "
              f"{spent.cpu_s:.1f} s CPU", flush=True)  # fmt: skip
        assert {one.state for one in outcomes} == {"registered"}
        asked = counted()
        write_finished(place, tasks, outcomes)
        skip_and_index(place, options.scans, calibration, asked)
        with s3_with(folder / "archive") as bucket:
            write_finished(bucket, tasks, outcomes)
            skip_and_index(bucket, options.scans, calibration, asked)


if __name__ == "__main__":
    main()
