"""One rule for merging, whichever way in: the daemon's scan and `handeyed register` on its folder give one cloud."""

import asyncio
import json
from pathlib import Path

import numpy as np
import pytest

from calibration.transforms import Array
from tests.daemon.calibrations import a_calibration, apply_calibration
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.cli.running import handeyed
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.fakes import ply_of, points_of
from tests.daemon.scans.scan_folders import a_scan


def holed(points: Array, *holes: tuple[int, int, float]) -> Array:
    """`points` with values put in, each as row, column, value."""
    for row, column, value in holes:
        points[row, column] = value
    return points


NAN, INF = float("nan"), float("inf")
TABLE = {
    "every point finite": ([cloud(300), cloud(200, 4)], None, 500, 0),
    "a NaN, and two infinities": (
        [holed(cloud(300), (7, 0, NAN)), holed(cloud(200, 4), (0, 1, INF), (1, 2, -INF))], None, 497, 3,
    ),
    "a view that saw nothing": ([cloud(300), np.full((40, 3), NAN)], None, 300, 40),
    "one cube for all": ([holed(cloud(300), (299, 2, NAN)), cloud(200, 4)], 1e4, None, 1),
}  # fmt: skip
"""Clouds (n, 3) in the camera's frame, voxel_mm, points merged (None: as the command says), points dropped."""


@pytest.mark.parametrize(("clouds", "voxel_mm", "points", "dropped"), TABLE.values(), ids=TABLE.keys())
async def test_rest_and_the_command_line_merge_alike(
    tmp_path: Path, clouds: list[Array], voxel_mm: float | None, points: int | None, dropped: int
) -> None:
    voxel = {} if voxel_mm is None else {"voxel_mm": voxel_mm}
    async with serving(settings_for(tmp_path / "store")) as bench:
        await apply_calibration(bench)
        scan = await a_scan(bench)
        for pose, seen in zip(POSES, clouds, strict=True):
            sent = await bench.client.post(
                scan["links"]["views"], params={"pose": pose}, content=ply_of(seen), headers=PLY
            )
            assert sent.status_code == 201, sent.text
        over_rest = (await bench.client.get(scan["links"]["cloud"], params=voxel)).content
        rest = (await bench.client.get(scan["links"]["report"])).json()
    (tmp_path / "calibration.json").write_text(a_calibration("cal-1").model_dump_json())
    folder = tmp_path / "store" / "scans" / scan["id"]
    options = [f"--{name.replace('_', '-')}={value}" for name, value in voxel.items()]
    arguments = ("register", folder, "--calibration", tmp_path / "calibration.json", "--out", tmp_path / "out.ply")
    ran = await asyncio.to_thread(handeyed, *arguments, "--json", *options)
    assert ran.status == 0, ran.err
    command = json.loads(ran.out)

    written = points_of((tmp_path / "out.ply").read_bytes())
    np.testing.assert_array_equal(points_of(over_rest), written)
    assert np.isfinite(written).all()
    assert command["points"] == len(written) == (len(written) if points is None else points)
    assert rest["points"] == sum(map(len, clouds)) - dropped
    for report in (rest, command):
        assert [view["points"] for view in report["views"]] == [len(seen) for seen in clouds]
        told = [found["message"] for found in report["verdict"]["findings"] if found["code"] == "points-not-finite"]
        assert [int(message.split()[0]) for message in told] == ([dropped] if dropped else [])
