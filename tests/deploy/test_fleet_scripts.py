"""deploy/fleet/index_archive.py and export_copc.py, asked by readers that nobody here wrote: pyarrow's and laspy's."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.s3 import s3_server

SCRIPTS = Path(__file__).resolve().parents[2] / "deploy" / "fleet"


def run(script: str, *arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(SCRIPTS / script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def a_finished_scan(folder: Path, name: str, points: int, after_mm: float | None) -> str:
    """What register-archive leaves of a scan, as docs/formats.md says; the cloud's hash."""
    at = folder / name
    at.mkdir(parents=True)
    sha256 = hashlib.sha256(name.encode()).hexdigest()
    files = [{"name": "merged.ply", "bytes": 9, "sha256": sha256}, {"name": "report.json", "bytes": 9, "sha256": "r"}]
    about = {"schema_version": 1, "scan": name, "calibration_id": "cal-1", "input_sha256": "i", "points": points,
             "accepted": after_mm is not None, "files": files}  # fmt: skip
    (at / "manifest.json").write_text(json.dumps(about))
    (at / "report.json").write_text(json.dumps({"rms_mm": {"before": 0.2, "after": after_mm}}))
    return sha256


def test_the_index_has_a_row_for_each_finished_scan_and_names_what_it_leaves_out(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not here: pip install 'handeyed[parquet]'")
    door = a_finished_scan(tmp_path, "door", 1000, None)
    roof = a_finished_scan(tmp_path, "2026/roof", 2000, 0.1)
    ran = run("index_archive.py", tmp_path)
    assert (ran.returncode, ran.stdout) == (0, f"{tmp_path}/outcomes.parquet: 2 scans\n"), ran.stderr
    rows: list[dict[str, Any]] = parquet.read_table(tmp_path / "outcomes.parquet").to_pylist()
    assert [(row["scan"], row["points"], row["accepted"], row["rms_mm"], row["cloud_sha256"]) for row in rows] == [
        ("2026/roof", 2000, True, 0.1, roof),
        ("door", 1000, False, 0.2, door),
    ]
    (tmp_path / "door" / "manifest.json").write_text('{"scan": ')
    a_finished_scan(tmp_path, "hood", 3000, 0.1)
    (tmp_path / "hood" / "report.json").unlink()
    ran = run("index_archive.py", tmp_path)
    assert ran.returncode == 3
    assert [line.partition(":")[0] for line in ran.stderr.splitlines()] == [f"{tmp_path}/door", f"{tmp_path}/hood"]
    assert parquet.read_table(tmp_path / "outcomes.parquet").num_rows == 1
    assert list(tmp_path.glob(".*")) == []


def test_the_index_of_results_in_s3_lies_beside_them(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not here: pip install 'handeyed[parquet]'")
    from pyarrow import BufferReader, parquet

    a_finished_scan(tmp_path / "out", "door", 1000, None)
    a_finished_scan(tmp_path / "out", "2026/roof", 2000, 0.1)
    with s3_server():
        s3: Any = pytest.importorskip("fsspec").filesystem("s3", skip_instance_cache=True)
        s3.mkdir("parts")
        s3.put(f"{tmp_path}/out", "parts/out", recursive=True)
        for _ in ("made", "made anew"):
            ran = run("index_archive.py", "s3://parts/out/")
            assert (ran.returncode, ran.stdout) == (0, "s3://parts/out/outcomes.parquet: 2 scans\n"), ran.stderr
        s3.invalidate_cache()
        assert sorted(s3.ls("parts/out", detail=False)) == [
            f"parts/out/{n}" for n in ("2026", "door", "outcomes.parquet")
        ]
        rows = parquet.read_table(BufferReader(s3.cat_file("parts/out/outcomes.parquet"))).to_pylist()
    assert [(row["scan"], row["points"]) for row in rows] == [("2026/roof", 2000), ("door", 1000)]


def test_a_copc_file_has_every_point_to_its_last_digit_and_answers_for_a_part(tmp_path: Path) -> None:
    pytest.importorskip("copclib", reason="copclib is not here: pip install 'handeyed[copc]'")
    laspy = pytest.importorskip("laspy")
    rng = np.random.default_rng(0)
    header = laspy.LasHeader(version="1.2", point_format=2)
    header.scales, header.offsets = [1e-4] * 3, [800.0, 0.0, -5.0]
    cloud = laspy.LasData(header)
    cloud.x, cloud.y = rng.uniform([800, -1], [803, 1], (60_000, 2)).T
    cloud.z = np.sin(cloud.x)
    cloud.red, cloud.intensity = rng.integers(0, 65_536, (2, 60_000))
    cloud.write(tmp_path / "door.laz")
    out = tmp_path / "door.copc.laz"
    ran = run("export_copc.py", tmp_path / "door.laz", out)
    assert (ran.returncode, ran.stdout) == (0, f"{out}: 60,000 points\n"), ran.stderr

    link = tmp_path / "link.copc.laz"
    link.symlink_to("elsewhere.laz")
    refused = run("export_copc.py", tmp_path / "door.laz", link)
    assert refused.returncode == 1
    assert "it is a link, not a file" in refused.stderr
    assert link.is_symlink()

    def rows(points: Any) -> "np.ndarray[Any, Any]":
        fields = np.column_stack(
            [np.asarray(getattr(points, name), int) for name in ("X", "Y", "Z", "red", "intensity")]
        )
        return fields[np.lexsort(fields.T)]

    with laspy.CopcReader.open(out) as reader:
        assert np.array_equal(rows(reader.query()), rows(cloud))
        coarse = reader.query(level=0)
        assert 0 < len(coarse) < 20_000, "a first look is a part of them"
        assert np.ptp(coarse.x) > 2.9, "spread over the whole"
        box = laspy.copc.Bounds(np.array([800.0, -1.0, -9.0]), np.array([801.0, 0.0, 9.0]))
        inside = (np.asarray(cloud.x) <= 801) & (np.asarray(cloud.y) <= 0)
        assert len(reader.query(bounds=box)) == inside.sum()
