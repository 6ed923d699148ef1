"""`handeyed register-archive`: the same bytes however many workers, resumed where it stopped, no scan stops another."""

import json
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import inverse, map_points, rotation_from_vector, transform
from daemon.tools.batch_registration.archive_run import FINISHED_NAME
from daemon.tools.batch_registration.remote_folder import RemoteFolder
from daemon.tools.batch_registration.tasks import MANIFEST_NAME, RegistrationTask, run_task
from tests.daemon.calibrations import a_calibration
from tests.daemon.cli.running import handeyed
from tests.daemon.fakes import FLANGE_T_CAMERA, ply_of
from tests.daemon.tools.dask_cluster import cluster
from tests.support.s3 import s3_server
from tests.support.terminal import on_terminal
from tests.support.waiting import eventually_blocking

pytestmark = pytest.mark.slow

pytest.importorskip("fsspec")


def a_scan(folder: Path, seed: int, points: int = 400) -> None:
    """A bumpy patch seen from three poses that err a little."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-100, 100, (points, 2))
    patch = np.column_stack([xy + np.array([850, 0]), 250 + 12 * np.sin(xy[:, 0] / 20) * np.cos(xy[:, 1] / 25)])
    views = []
    for index in range(3):
        flange = transform(rotation_from_vector([np.pi, 0.1 * index, 0]), [800.0, 10.0 * index, 700])
        seen = map_points(inverse(flange @ FLANGE_T_CAMERA), patch + rng.normal(0, 0.1, 3))
        (folder / f"view_{index}.ply").write_bytes(ply_of(seen))
        pose = PoseDocument.of(flange).model_dump(mode="json")
        views.append({"cloud": f"view_{index}.ply", "unit": "mm", "base_T_flange": pose})
    document = {"schema_version": 1, "source": "test", "setup": "eye-in-hand", "views": views}
    (folder / "scan.json").write_text(json.dumps(document))


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Four scans, two of them deeper."""
    for seed, name in enumerate(("door", "hood", "2026/fender", "2026/roof")):
        a_scan(tmp_path / "archive" / name, seed)
    return tmp_path / "archive"


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    (tmp_path / "calibration.json").write_text(a_calibration("cal-1").model_dump_json())
    return tmp_path / "calibration.json"


def command(archive: Path, calibration: Path, out: Path, *more: str) -> list[str]:
    return ["register-archive", str(archive), "--calibration", str(calibration), "--out", str(out), *more]


def bytes_of(folder: Path) -> dict[str, bytes]:
    """The results by their names; finished.json is about these files, and so another one for others."""
    files = [file for file in sorted(folder.rglob("*")) if file.is_file() and file.name != FINISHED_NAME]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def states(out: str) -> dict[str, str]:
    return {line["scan"]: line["state"] for line in map(json.loads, out.splitlines())}


def test_one_process_and_any_number_of_workers_write_the_same_bytes(
    tmp_path: Path, archive: Path, calibration: Path
) -> None:
    pytest.importorskip("distributed")
    assert handeyed(*command(archive, calibration, tmp_path / "here", "--scheduler", "here", "--refine")).status == 0
    for workers in ("1", "2"):
        out = tmp_path / f"workers{workers}"
        more = ("--scheduler", "local", "--workers", workers, "--refine")
        ran = subprocess.run(
            [sys.executable, "-m", "daemon.cli", *command(archive, calibration, out, *more)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert (ran.returncode, ran.stderr) == (0, "")
        assert "4 scans (4 registered), 4,800 points" in ran.stdout
        assert bytes_of(out) == bytes_of(tmp_path / "here")
    assert len(bytes_of(tmp_path / "here")) == 4 * 3


def test_whoever_sits_before_it_sees_how_far_it_is(tmp_path: Path, archive: Path, calibration: Path) -> None:
    arguments = command(archive, calibration, tmp_path / "out", "--scheduler", "here")
    seen = on_terminal([sys.executable, "-m", "daemon.cli", *arguments])
    assert seen.status in (0, 3)
    assert "4/4" in seen.shown
    assert b"4 scans (4 registered)" in seen.out


def test_killed_in_the_middle_it_goes_on_where_it_stopped(tmp_path: Path, archive: Path, calibration: Path) -> None:
    for seed in range(4, 16):
        a_scan(archive / f"part{seed}", seed, points=1500)
    out = tmp_path / "out"
    arguments = command(archive, calibration, out, "--scheduler", "here", "--json")
    with subprocess.Popen([sys.executable, "-m", "daemon.cli", *arguments], stdout=subprocess.DEVNULL) as process:
        eventually_blocking(lambda: len(list(out.rglob(MANIFEST_NAME))) >= 2)
        process.send_signal(signal.SIGKILL)
    finished = {file.parent.relative_to(out).as_posix() for file in out.rglob(MANIFEST_NAME)}
    assert 2 <= len(finished) < 16
    ran = handeyed(*arguments)
    assert ran.status == 0
    assert {scan for scan, state in states(ran.out).items() if state == "unchanged"} == finished
    handeyed(*command(archive, calibration, tmp_path / "whole", "--scheduler", "here"))
    left = {name: content for name, content in bytes_of(out).items() if not name.endswith(".part")}
    assert left == bytes_of(tmp_path / "whole")


def test_a_broken_scan_is_named_and_stops_no_other(tmp_path: Path, archive: Path, calibration: Path) -> None:
    (archive / "hood" / "view_1.ply").write_bytes(ply_of(np.zeros((50, 3)))[:-5])
    (archive / "door" / "view_2.ply").unlink()
    ran = handeyed(*command(archive, calibration, tmp_path / "out", "--scheduler", "here", "--json"))
    assert ran.status == 2
    assert states(ran.out) == {
        "door": "failed", "hood": "failed", "2026/fender": "registered", "2026/roof": "registered"
    }  # fmt: skip
    assert len(ran.errors) == 2
    assert any("hood" in line and "view_1.ply" in line for line in ran.errors)
    assert any("door" in line and "view_2.ply" in line for line in ran.errors)
    assert not (tmp_path / "out" / "hood" / "merged.ply").exists()


def test_a_unit_that_cannot_be_fails_one_scan_without_force(tmp_path: Path, archive: Path, calibration: Path) -> None:
    document = json.loads((archive / "door" / "scan.json").read_text())
    views = [{**view, "unit": "m"} for view in document["views"]]
    (archive / "door" / "scan.json").write_text(json.dumps({**document, "views": views}))
    arguments = command(archive, calibration, tmp_path / "out", "--scheduler", "here", "--json")
    refused = handeyed(*arguments)
    assert (refused.status, states(refused.out)["door"]) == (2, "failed")
    assert "every point is farther than 20 m" in refused.err
    forced = handeyed(*arguments, "--force")
    assert (forced.status, set(states(forced.out).values())) == (3, {"registered"})


def test_what_changed_is_registered_again_and_nothing_else(tmp_path: Path, archive: Path, calibration: Path) -> None:
    arguments = command(archive, calibration, tmp_path / "out", "--scheduler", "here", "--json")
    assert set(states(handeyed(*arguments).out).values()) == {"registered"}
    assert set(states(handeyed(*arguments).out).values()) == {"unchanged"}
    cloud = archive / "door" / "view_0.ply"
    cloud.write_bytes(cloud.read_bytes()[:-12] + np.zeros(3, "<f4").tobytes())
    (tmp_path / "out" / "hood" / "merged.ply").unlink()
    again = states(handeyed(*arguments).out)
    assert {scan for scan, state in again.items() if state == "registered"} == {"door", "hood"}
    other = a_calibration("cal-2").model_dump_json()
    calibration.write_text(other)
    assert set(states(handeyed(*arguments).out).values()) == {"registered"}


def test_scans_and_results_may_lie_anywhere_fsspec_reaches(archive: Path, tmp_path: Path) -> None:
    import fsspec

    memory: Any = fsspec.filesystem("memory")
    memory.put(str(archive), "/in", recursive=True)
    source, target = RemoteFolder.from_url("memory://in"), RemoteFolder.from_url("memory://out")
    calibration = a_calibration("cal-1").model_dump_json()
    scans = sorted(source.list_marks())
    assert scans == ["2026/fender", "2026/roof", "door", "hood"]
    tasks = [RegistrationTask(source.url, target.url, scan, calibration) for scan in scans]
    assert [run_task(task).state for task in tasks] == ["registered"] * 4
    assert [run_task(task).state for task in tasks] == ["unchanged"] * 4
    local = [RegistrationTask(str(archive), str(tmp_path / "out"), scan, calibration) for scan in scans]
    assert [run_task(task).state for task in local] == ["registered"] * 4
    assert bytes_of(tmp_path / "out") == {
        f"{scan}/{name}": memory.cat_file(f"/out/{scan}/{name}")
        for scan in scans
        for name in ("manifest.json", "merged.ply", "report.json")
    }


@pytest.fixture
def bucket() -> Iterator[str]:
    """An empty bucket of an S3 server."""
    with s3_server():
        yield "s3://parts"


def test_scans_and_results_may_lie_in_s3(archive: Path, tmp_path: Path, calibration: Path, bucket: str) -> None:
    import fsspec

    s3: Any = fsspec.filesystem("s3", skip_instance_cache=True)
    s3.mkdir(bucket)
    s3.put(str(archive), f"{bucket}/in", recursive=True)
    there = ["register-archive", f"{bucket}/in", "--calibration", str(calibration), "--out", f"{bucket}/out", "--json"]
    assert set(states(handeyed(*there, "--scheduler", "here").out).values()) == {"registered"}
    assert set(states(handeyed(*there, "--scheduler", "here").out).values()) == {"unchanged"}
    s3.rm_file(f"{bucket}/out/door/merged.ply")
    assert states(handeyed(*there, "--scheduler", "here").out)["door"] == "registered"
    handeyed(*command(archive, calibration, tmp_path / "out", "--scheduler", "here"))
    for name, content in bytes_of(tmp_path / "out").items():
        assert s3.cat_file(f"{bucket}/out/{name}") == content


def counted(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Requests to S3 by their names, from now on."""
    client = pytest.importorskip("aiobotocore.client").AioBaseClient
    ask, asked = client._make_api_call, Counter[str]()

    async def count(self: Any, name: str, parameters: Any) -> Any:
        asked[name] += 1
        return await ask(self, name, parameters)

    monkeypatch.setattr(client, "_make_api_call", count)
    return asked


def test_finished_scans_in_s3_are_skipped_by_two_listings_however_many_there_are(
    archive: Path, calibration: Path, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fsspec

    s3: Any = fsspec.filesystem("s3", skip_instance_cache=True)
    s3.mkdir(bucket)
    there = ["register-archive", f"{bucket}/in", "--calibration", str(calibration), "--out", f"{bucket}/out", "--json",
             "--scheduler", "here"]  # fmt: skip
    for more in (0, 4):
        for seed in range(more):
            a_scan(archive / f"part{seed}", seed)
        s3.put(str(archive) + "/", f"{bucket}/in/", recursive=True)
        handeyed(*there)
        asked = counted(monkeypatch)
        assert set(states(handeyed(*there).out).values()) == {"unchanged"}
        assert asked == {"ListObjectsV2": 2, "GetObject": 1}
    cloud = f"{bucket}/in/door/view_0.ply"
    s3.pipe_file(cloud, s3.cat_file(cloud)[:-12] + np.zeros(3, "<f4").tobytes())  # of the same size
    s3.rm_file(f"{bucket}/out/hood/report.json")
    found = states(handeyed(*there).out)
    assert {scan for scan, state in found.items() if state == "registered"} == {"door", "hood"}


@pytest.mark.parametrize("content", [b"", b"[1]", b'{"0": 3}', b'{"0": {"scan": "door"}}', b"\xff", None])
def test_without_a_good_finished_json_the_contents_are_compared(
    tmp_path: Path, archive: Path, calibration: Path, content: bytes | None
) -> None:
    arguments = command(archive, calibration, tmp_path / "out", "--scheduler", "here", "--json")
    handeyed(*arguments)
    finished = tmp_path / "out" / FINISHED_NAME
    known = finished.read_bytes()
    finished.unlink() if content is None else finished.write_bytes(content)
    assert set(states(handeyed(*arguments).out).values()) == {"unchanged"}
    assert finished.read_bytes() == known


def test_options_and_place_are_part_of_what_is_finished(tmp_path: Path, archive: Path, calibration: Path) -> None:
    arguments = command(archive, calibration, tmp_path / "out", "--scheduler", "here", "--json")
    handeyed(*arguments)
    assert set(states(handeyed(*arguments, "--voxel-mm", "2").out).values()) == {"registered"}
    shutil.copytree(tmp_path / "out", tmp_path / "copy")
    elsewhere = command(archive, calibration, tmp_path / "copy", "--scheduler", "here", "--json", "--voxel-mm", "2")
    monitored = handeyed(*elsewhere)
    assert set(states(monitored.out).values()) == {"unchanged"}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--scheduler", "nobody"), "'nobody' is no scheduler"),
        (("--out", "nowhere://x"), "no place fsspec knows"),
    ],
)
def test_what_cannot_begin_is_reported(
    tmp_path: Path, archive: Path, calibration: Path, more: tuple[str, ...], words: str
) -> None:
    ran = handeyed(*command(archive, calibration, tmp_path / "out", *more))
    assert ran.status == 1
    assert words in ran.err


def test_a_folder_without_scans_is_reported(tmp_path: Path, calibration: Path) -> None:
    (tmp_path / "empty").mkdir()
    ran = handeyed(*command(tmp_path / "empty", calibration, tmp_path / "out"))
    assert (ran.status, ran.out) == (2, "")
    assert "no folder below holds a scan.json" in ran.err


def test_a_scheduler_that_is_killed_is_one_error_and_the_same_command_resumes(
    tmp_path: Path, archive: Path, calibration: Path
) -> None:
    pytest.importorskip("distributed")
    for seed in range(4, 24):
        a_scan(archive / f"part{seed}", seed)
    out = tmp_path / "out"
    with cluster(1) as (address, scheduler, _):
        more = command(archive, calibration, out, "--scheduler", address)
        with subprocess.Popen(
            [sys.executable, "-m", "daemon.cli", *more], stderr=subprocess.PIPE, text=True
        ) as running:
            eventually_blocking(lambda: len(list(out.rglob(MANIFEST_NAME))) >= 2)
            scheduler.kill()
            _, errors = running.communicate()
    assert running.returncode == 1
    (error,) = errors.strip().splitlines()
    assert "the Dask scheduler is gone" in error
    assert "finished scans are skipped" in error
    again = handeyed(*command(archive, calibration, out, "--scheduler", "here", "--json"))
    assert again.status == 0
    assert "unchanged" in states(again.out).values()
    handeyed(*command(archive, calibration, tmp_path / "whole", "--scheduler", "here"))
    left = {name: content for name, content in bytes_of(out).items() if not name.endswith(".part")}
    assert left == bytes_of(tmp_path / "whole")
