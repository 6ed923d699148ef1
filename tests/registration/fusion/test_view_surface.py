"""One view as a surface: its points, normals, and signed distances from the other views."""

from pathlib import Path

import numpy as np
import pytest

from calibration.transforms import Array, transform
from registration.fusion.concatenation import PlacedCloud
from registration.fusion.view_surface import view_surface
from tests.daemon.fakes import ply_of

CAMERA = transform(np.eye(3), [0.0, 0.0, 600.0])


def sheet(folder: Path, name: str, z_mm: float, width_mm: float = 100.0) -> PlacedCloud:
    """A level sheet, `width_mm` wide, `z_mm` above the base's floor, seen from 600 mm above the floor."""
    x, y = np.random.default_rng(len(name)).uniform(-width_mm / 2, width_mm / 2, (2, 20_000))
    file = folder / f"{name}.ply"
    points: Array = np.column_stack([x, y, np.full(len(x), z_mm - 600.0)])
    file.write_bytes(ply_of(points))
    return PlacedCloud(file, "mm", CAMERA)


def test_a_view_above_the_others_deviates_towards_its_camera(tmp_path: Path) -> None:
    clouds = [sheet(tmp_path, "a", 0.25), sheet(tmp_path, "bb", 0.0, 60.0)]
    found = view_surface(clouds, 0, 2.0)
    inside = (np.abs(found["x"]) < 25) & (np.abs(found["y"]) < 25)
    outside = (np.abs(found["x"]) > 40) | (np.abs(found["y"]) > 40)
    assert found["deviation"][inside] == pytest.approx(0.25, abs=1e-3)
    assert np.isnan(found["deviation"][outside]).all()
    assert found["nz"] == pytest.approx(1.0, abs=1e-3), "towards the camera"
    assert view_surface(clouds, 1, 2.0)["deviation"] == pytest.approx(-0.25, abs=1e-3)


def test_a_box_holds_its_own_points_and_is_compared_with_those_around_it(tmp_path: Path) -> None:
    clouds = [sheet(tmp_path, "a", 0.25), sheet(tmp_path, "bb", 0.0)]
    found = view_surface(clouds, 0, 1.0, ((-10.0, -10.0, -1.0), (10.0, 10.0, 1.0)))
    assert 300 < len(found) < 500
    assert found["deviation"] == pytest.approx(0.25, abs=1e-3)


def test_a_single_view_deviates_from_nothing(tmp_path: Path) -> None:
    assert np.isnan(view_surface([sheet(tmp_path, "a", 0.0)], 0, 5.0)["deviation"]).all()
