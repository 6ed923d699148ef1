"""How far merges, surfaces and registrations are: increasing, seldom, and as events."""

import asyncio
import threading
from pathlib import Path

import numpy as np
import pytest

from calibration.kinematics.stance import Stance
from calibration.problem import Setup
from calibration.transforms import transform
from daemon.scans import registration_jobs
from daemon.scans.registration_jobs import INTERVAL_S, STEP, ProgressReports, StepEnd
from registration.fusion.concatenation import PlacedCloud, merge_clouds
from registration.fusion.merging import Merge
from registration.fusion.view_surface import view_surface
from registration.scan import ScannerMount, ScanView, register_views, sample_views
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.fakes import ply_of
from tests.daemon.scans.scan_folders import a_scan


async def test_a_job_reports_seldom_and_never_less_than_before() -> None:
    reported: list[float] = []
    times_s = [0.0]
    reports = ProgressReports(reported.append, lambda: times_s[-1])
    for at_s, share in (
        (0.1, 0.5), (1.0, 0.5), (1.1, 0.9), (2.0, 0.5 + 0.9 * STEP), (2.1, 0.6), (3.0 + INTERVAL_S, 0.3), (9.0, 1.0),
    ):  # fmt: skip
        times_s.append(at_s)
        reports(share)
    await asyncio.sleep(0)
    assert reported == [0.5, 0.6, 1.0]


def test_a_job_rests_as_long_as_its_step_took_while_a_run_is_in_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """It waited for others for 300 s before it began."""
    rests_s: list[float] = []
    moments = [(0.0, False)]  # the clock, and whether a run is in progress
    stop = threading.Event()
    monkeypatch.setattr(stop, "wait", rests_s.append)
    stopped = StepEnd(stop, lambda: moments[-1][1], lambda: moments[-1][0])
    for moment in ((300.0, True), (300.2, False), (300.5, True), (300.75, True), (301.0, False)):
        moments.append(moment)
        assert not stopped()
    stop.set()
    assert stopped()
    assert rests_s == pytest.approx([0.3, 0.25])


def parts_of(folder: Path, points: int = 30_000) -> list[PlacedCloud]:
    """Two views of a plate, 2 mm apart along z, in several blocks each."""
    x, y = np.meshgrid(np.arange(200.0), np.arange(points // 200))
    plate = np.column_stack([x.ravel(), y.ravel(), 0.05 * np.sin(x.ravel())])
    placed = []
    for index in range(2):
        file = folder / f"view_{index}.ply"
        file.write_bytes(ply_of(plate))
        placed.append(PlacedCloud(file, "mm", transform(np.eye(3), [0.0, 0.0, 0.5 * index])))
    return placed


@pytest.mark.parametrize(("merge", "end"), [(Merge(), 1.0), (Merge(voxel_mm=5.0), 0.9)])
def test_a_merge_is_as_far_as_it_has_read(tmp_path: Path, merge: Merge, end: float) -> None:
    shares: list[float] = []
    merge_clouds(parts_of(tmp_path), tmp_path / "merged.ply", merge=merge, on_progress=shares.append)
    assert shares == sorted(shares)
    assert len(shares) > 4
    assert shares[-1] == pytest.approx(end)


def test_a_surface_is_done_when_every_point_has_its_deviation(tmp_path: Path) -> None:
    shares: list[float] = []
    view_surface(parts_of(tmp_path), 0, 2.0, on_progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_registration_is_as_far_as_views_are_read_and_iterations_made(tmp_path: Path) -> None:
    setup: Setup = "eye-in-hand"
    views = [ScanView(part.file, part.unit, Stance(part.base_T_cloud), setup) for part in parts_of(tmp_path)]
    read: list[float] = []
    samples = sample_views(views, read.append)
    assert (read, read[-1]) == (sorted(read), 1.0)
    assert any(0 < share < 0.5 for share in read), "also within a view"
    done: list[float] = []
    register_views(views, samples, ScannerMount("c", np.eye(4)), refine=True, on_progress=done.append)
    assert done == sorted(done)
    assert 0 < done[0] < done[-1] < 1


async def test_a_long_merge_says_by_events_how_far_it_is(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registration_jobs, "INTERVAL_S", 0.0)
    await apply_calibration(bench)
    scan = await a_scan(bench)
    for pose in POSES[:2]:
        sent = ply_of(cloud(20_000))
        await bench.client.post(scan["links"]["views"], params={"pose": pose}, content=sent, headers=PLY)
    await bench.client.get(scan["links"]["cloud"], params={"view": 1})
    await bench.client.get(f"/scans/{scan['id']}/surface", params={"view": 0, "voxel_mm": 5.0})
    await bench.application.events.flush()
    told = [event.data for event in bench.application.events._kept if event.kind == "cloud"]
    for work, view in (("merge", 1), ("surface", 0)):
        shares = [data["progress"] for data in told if (data["work"], data["view"]) == (work, view)]
        assert shares == sorted(set(shares))
        assert shares[-1] == 1.0
        assert len(shares) <= 1 / STEP
    assert {data["scan_id"] for data in told} == {scan["id"]}
