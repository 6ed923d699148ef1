"""Clouds and poses of extreme numbers: registered, or refused by a typed error, and never a numerical one."""

import json
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from calibration.errors import DocumentError
from registration.errors import RegistrationError, ScanError
from registration.fusion.merging import Merge
from registration.io.convert import move_file
from registration.io.writing import new_cloud
from registration.points.layout import Layout
from registration.points.rigid_motion import RigidMotion
from registration.scan_folder import read_scan, register_scan
from tests.registration.parts import FLANGE_T_CAMERA, HAND, ticks, write_scan
from tests.support.cases import cases

LAYOUTS = [
    Layout.of(np.dtype([(name, kind) for name in ("x", "y", "z")] + more))
    for kind in ("<f4", "<f8")
    for more in ([], [(name, "<f4") for name in ("nx", "ny", "nz")] + [("quality", "<f8"), ("red", "u1")])
]

EXTREME = [0.0, -0.0, 1e-320, -1e-45, 1e-8, 1.0, -1e3, 1e6, 1.0000001e6, 1e18, 3.4e38, -3.4e38, 1e200, 1.79e308,
           -1.79e308, np.inf, -np.inf, np.nan]  # fmt: skip
NUMBERS = st.sampled_from(EXTREME) | st.floats(width=64)
LENGTHS = st.sampled_from([1e-300, 1e-6, 0.5, 1e6, 1e300])
MERGES = [
    {},
    {"voxel_mm": 1.0},
    {"voxel_mm": 1.0, "normals": True},
    {"voxel_mm": 1.0, "outliers": "statistical"},
    {"voxel_mm": 1.0, "outliers": "radius", "normals": True},
]


@st.composite
def clouds(draw: st.DrawFn, layout: Layout) -> np.ndarray:
    """Up to 300 points: a sheet, all columns of a few numbers, or both."""
    count = draw(st.sampled_from([0, 1, 2, 3, 15, 300]))
    records = np.zeros(count, layout.dtype)
    random = np.random.default_rng(draw(st.integers(0, 99)))
    with np.errstate(all="ignore"):
        for axis, name in enumerate(layout.dtype.names or ()):
            if layout.dtype[name].kind == "f":
                spread = 0.1 if axis == 2 else 20.0
                records[name] = random.normal(0, spread, count)
                if count and draw(st.booleans()):
                    some = random.random(count) <= draw(st.sampled_from([0.01, 0.5, 1.0]))
                    records[name][some] = draw(NUMBERS)
    return records


def pose(values: list[float]) -> dict[str, object]:
    return {"translation_mm": values, "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]}


POSES = st.lists(NUMBERS.filter(np.isfinite), min_size=3, max_size=3) | st.just([0.0, 0.0, 500.0])


@pytest.mark.slow
@pytest.mark.timeout(0)
@settings(
    max_examples=cases(60),
    deadline=None,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.data())
def test_any_numbers_are_registered_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    layout, unit = data.draw(st.sampled_from(LAYOUTS)), data.draw(st.sampled_from(["mm", "m"]))
    views = []
    for index in range(data.draw(st.integers(1, 3))):
        with new_cloud(tmp_path / f"{index}.ply", layout) as writer:
            writer.write(data.draw(clouds(layout)))
        views.append({"cloud": f"{index}.ply", "unit": unit, "base_T_flange": pose(data.draw(POSES))})
    scan = {"schema_version": 1, "source": "", "setup": "eye-in-hand", "views": views}
    (tmp_path / "scan.json").write_text(json.dumps(scan))
    settings_of_merge = dict(data.draw(st.sampled_from(MERGES)))
    if "voxel_mm" in settings_of_merge:
        settings_of_merge["voxel_mm"] = data.draw(LENGTHS)
    with suppress(RegistrationError, DocumentError):
        merge, refine = Merge(**settings_of_merge), data.draw(st.booleans())
        register_scan(read_scan(tmp_path), HAND, tmp_path / "out.ply", ticks(), refine=refine, merge=merge)
    for suffix in (".ply", ".pcd", ".npy"):
        with suppress(RegistrationError):
            motion = RigidMotion.of(FLANGE_T_CAMERA, unit)
            move_file(tmp_path / "0.ply", tmp_path / f"moved{suffix}", motion)


def test_a_cloud_of_no_measurements_is_named(tmp_path: Path) -> None:
    write_scan(tmp_path, [np.full((500, 3), 3e38)], [np.eye(4)])
    for refine in (False, True):
        with pytest.raises(ScanError, match=r"view_000\.ply: no point lies within 1 km"):
            register_scan(read_scan(tmp_path), HAND, tmp_path / "out.ply", ticks(), refine=refine)
