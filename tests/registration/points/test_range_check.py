"""Clouds in a unit that cannot be: every point at the camera, or beyond the reach of any scanner on an arm."""

import json
from pathlib import Path

import numpy as np
import pytest

from registration.errors import ScanError
from registration.points.layout import XYZ_FLOAT64
from registration.points.range_check import RangeCheck, range_of
from registration.scan_folder import read_scan, register_scan
from tests.registration.parts import HAND, flat, poses, ticks, view_of, write_scan

NONE = float("nan")


@pytest.mark.parametrize(
    ("unit", "depths", "says"),
    [
        ("mm", [0.5, 0.7], "nearer than 1 mm"),
        ("m", [500.0, 700.0], "farther than 20 m"),
        ("mm", [0.0, 0.0], None),
        ("mm", [0.5, 9e9], "nearer than 1 mm or farther than 20 m"),
        ("mm", [0.0, 9e9], "every point is farther than 20 m"),
        ("mm", [NONE, 0.5], "nearer than 1 mm"),
        ("mm", [0.0, 500.0], None),
        ("m", [9e9, 0.5, NONE], None),
        ("mm", [NONE], None),
        ("mm", [], None),
    ],
)
def test_a_unit_cannot_be_where_no_point_can(unit: str, depths: list[float], says: str | None) -> None:
    check = RangeCheck(unit)
    block = np.zeros(len(depths), XYZ_FLOAT64.dtype)
    block["z"] = depths
    for piece in (block[:1], block[1:]):
        check.look(piece, XYZ_FLOAT64)
    assert (says is None) == (check.doubt is None)
    assert says is None or says in str(check.doubt)


def test_a_scan_of_an_impossible_unit_is_refused_unless_forced(tmp_path: Path) -> None:
    stands = poses(2)
    write_scan(tmp_path, [view_of(flat, pose @ HAND.flange_T_camera, 1) / 1e3 for pose in stands], stands, "mm")
    out = tmp_path / "out.ply"
    with pytest.raises(ScanError, match=r"views 1, 2: every point is nearer than 1 mm .*force"):
        register_scan(read_scan(tmp_path), HAND, out, ticks())
    assert not out.exists()
    report = register_scan(read_scan(tmp_path), HAND, out, ticks(), force=True)
    assert not report.verdict.accepted
    assert "unit-impossible" in [finding.code for finding in report.verdict.findings]


@pytest.mark.parametrize(
    ("stated_mm", "reach_mm", "depth_mm", "says"),
    [
        (None, None, 1.5, None),
        ((300.0, 900.0), None, 1.5, "nearer than 150 mm"),
        ((900.0, 300.0), None, 160.0, None),
        ((300.0, 900.0), 500.0, 1700.0, None),
        ((300.0, 900.0), None, 1900.0, "farther than 1.8 m"),
        (None, 900.0, 1900.0, "farther than 1.8 m"),
        (None, 900.0, 1.5, None),
        (None, 30_000.0, 21_000.0, "farther than 20 m"),
    ],
)
def test_what_can_be_follows_the_scanner_or_else_the_arm(
    stated_mm: tuple[float, float] | None, reach_mm: float | None, depth_mm: float, says: str | None
) -> None:
    check = RangeCheck("mm", range_of(stated_mm, reach_mm))
    block = np.zeros(3, XYZ_FLOAT64.dtype)
    block["z"] = depth_mm
    check.look(block, XYZ_FLOAT64)
    assert (says is None) == (check.doubt is None)
    assert says is None or says in str(check.doubt)


def test_a_scan_states_the_range_of_its_scanner(tmp_path: Path) -> None:
    stands = poses(2)
    write_scan(tmp_path, [view_of(flat, pose @ HAND.flange_T_camera, 1) for pose in stands], stands, "mm")
    document = tmp_path / "scan.json"
    document.write_text(json.dumps({**json.loads(document.read_text()), "range_mm": [20_000, 30_000]}))
    with pytest.raises(ScanError, match=r"every point is nearer than 10000 mm"):
        register_scan(read_scan(tmp_path), HAND, tmp_path / "out.ply", ticks())
