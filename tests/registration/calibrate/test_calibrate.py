"""X from clouds: of a sphere, and of any part whose views overlap; refused where they do not tell."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument, calibration_document
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.problem import Setup
from calibration.solution import Solution
from calibration.transforms import Array, difference, inverse, map_points, rotation_from_vector, transform
from calibration.verdict import VerdictLimits
from registration.calibrate import surface_search
from registration.calibrate.outcome import judge_scan
from registration.calibrate.sphere import solve_sphere_scan
from registration.calibrate.surfaces import solve_surface_scan
from registration.errors import ScanError
from registration.scan import register_views, sample_views, scanner_mount_of
from registration.scan_folder import read_scan
from tests.registration.parts import FLANGE_T_CAMERA, HAND, bumpy, flat, poses, view_of, write_scan, wrong
from tests.registration.spheres import CENTRE_IN_BASE, cap, looks

pytestmark = pytest.mark.slow

NOISE = RobotNoise(0.3, float(np.deg2rad(0.03)))
ROUGH = FLANGE_T_CAMERA @ transform(rotation_from_vector([0.02, -0.015, 0.02]), [2.0, -3.0, 2.0])


STATED = VerdictLimits().with_tolerance(4.0)
"""Clouds of parts without a target leave U of 1 to 4 mm."""


def document_of(solution: Solution) -> CalibrationDocument:
    return calibration_document(
        solution, judge_scan(solution, STATED), calibration_id="c1", created_at="2026-11-20T08:00:00Z", software="test"
    )


def sphere_scan(folder: Path, flange: list[Array], missing: tuple[int, ...] = (), setup: Setup = "eye-in-hand") -> None:
    clouds = []
    for index, pose in enumerate(flange):
        centre = map_points(inverse(pose @ FLANGE_T_CAMERA), CENTRE_IN_BASE[None])[0]
        clouds.append(np.zeros((500, 3)) if index in missing else cap(centre, 30.0, index))
    write_scan(folder, clouds, flange if setup == "eye-in-hand" else [inverse(pose) for pose in flange], setup=setup)


def part_scan(folder: Path, height: object, flange: list[Array], errs: bool = True) -> None:
    clouds = [view_of(height, pose @ FLANGE_T_CAMERA, index) for index, pose in enumerate(flange)]
    said = [wrong(pose, 0.3, 0.03, index) if errs else pose for index, pose in enumerate(flange)]
    write_scan(folder, clouds, said)


def test_a_sphere_gives_a_calibration_that_registers(tmp_path: Path) -> None:
    sphere_scan(tmp_path, looks(8), missing=(3,))
    solution = solve_sphere_scan(read_scan(tmp_path), 30.0)
    assert solution.mount_T_camera is not None
    translation_mm, rotation_rad = difference(solution.mount_T_camera, FLANGE_T_CAMERA)
    assert translation_mm < 0.5
    assert rotation_rad < 2e-3
    document = CalibrationDocument.model_validate_json(document_of(solution).model_dump_json())
    assert document.verdict.accepted
    assert [view.status for view in document.views].count("used") == 7
    assert (document.views[3].reason or "").startswith("sphere-not-found")
    np.testing.assert_allclose(scanner_mount_of(document).flange_T_camera, solution.mount_T_camera, atol=1e-9)


def test_too_few_spheres_are_refused_in_a_document_without_x(tmp_path: Path) -> None:
    sphere_scan(tmp_path, looks(5), missing=(0, 1))
    document = document_of(solve_sphere_scan(read_scan(tmp_path), 30.0))
    assert document.flange_T_camera is None
    assert not document.verdict.accepted
    assert [finding.severity for finding in document.verdict.findings] == ["error"]


def test_a_sphere_on_the_flange_gives_where_a_standing_camera_is(tmp_path: Path) -> None:
    sphere_scan(tmp_path, looks(8), setup="eye-to-hand")
    solution = solve_sphere_scan(read_scan(tmp_path), 30.0)
    assert solution.mount_T_camera is not None
    assert difference(solution.mount_T_camera, FLANGE_T_CAMERA) < (0.5, 2e-3)
    document = document_of(solution)
    assert document.verdict.accepted
    assert document.setup == "eye-to-hand" and document.flange_T_camera is None
    assert document.base_T_camera is not None
    np.testing.assert_allclose(document.base_T_camera.transform(), solution.mount_T_camera, atol=1e-9)
    assert "mm on the flange" in next(f.message for f in document.verdict.findings if f.code == "sphere-centre")


@pytest.mark.parametrize("rough", [ROUGH, None], ids=["with a rough X", "searched"])
def test_a_part_on_the_flange_gives_where_a_standing_camera_is(tmp_path: Path, rough: Array | None) -> None:
    mounts = poses(8)
    clouds = [view_of(bumpy, pose @ FLANGE_T_CAMERA, index) for index, pose in enumerate(mounts)]
    said = [wrong(inverse(pose), 0.3, 0.03, index) for index, pose in enumerate(mounts)]
    write_scan(tmp_path, clouds, said, setup="eye-to-hand")
    solution = solve_surface_scan(read_scan(tmp_path), rough, rough_mm=20.0)
    assert solution.mount_T_camera is not None and solution.uncertainty is not None
    error = inverse(FLANGE_T_CAMERA) @ solution.mount_T_camera
    assert np.all(np.abs(error[:3, 3]) < 3 * np.sqrt(np.diagonal(solution.uncertainty.covariance))[3:])
    assert 0.15 < (solution.noise.robot_translation_mm or 0) < 0.6, "0.3 mm is true, 1 mm what it begins with"
    corrections_mm = [view.robot_correction[0] for view in solution.views if view.robot_correction is not None]
    errors_mm = [(inverse(pose) - reported)[:3, 3] for pose, reported in zip(mounts, said, strict=True)]
    assert np.corrcoef(np.ravel(corrections_mm), np.ravel(errors_mm))[0, 1] > 0.7, "as moves of the flange in base"
    document = document_of(solution)
    assert document.verdict.accepted and document.base_T_camera is not None


def test_views_of_a_part_on_the_flange_are_not_registered_in_base(tmp_path: Path) -> None:
    sphere_scan(tmp_path, looks(3), setup="eye-to-hand")
    views = read_scan(tmp_path)
    with pytest.raises(ScanError, match="moves with the flange"):
        register_views(views, sample_views(views), HAND)


@pytest.mark.parametrize("part", ["plane", "sphere"])
def test_a_surface_that_slides_on_itself_is_refused_before_the_search(
    tmp_path: Path, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(surface_search, "_starts", lambda views: pytest.fail("it was searched"))
    if part == "plane":
        part_scan(tmp_path, flat, poses(6))
    else:
        sphere_scan(tmp_path, looks(6))
    (finding,) = solve_surface_scan(read_scan(tmp_path), None).findings
    assert (finding.code, finding.severity) == ("surfaces-ambiguous", "error")
    assert finding.message.startswith("each view's surface is that of a plane or a sphere")


def test_a_part_without_a_target_gives_x(tmp_path: Path) -> None:
    part_scan(tmp_path, bumpy, poses(10))
    solution = solve_surface_scan(read_scan(tmp_path), ROUGH, rough_mm=20.0)
    assert solution.mount_T_camera is not None
    assert solution.uncertainty is not None
    assert 0.15 < (solution.noise.robot_translation_mm or 0) < 0.6, "0.3 mm is true, 1 mm what it begins with"
    error = inverse(FLANGE_T_CAMERA) @ solution.mount_T_camera
    deviations = np.sqrt(np.diagonal(solution.uncertainty.covariance))
    assert np.all(np.abs(error[:3, 3]) < 3 * deviations[3:])
    assert np.linalg.norm(error[:3, 3]) < 0.2 * difference(ROUGH, FLANGE_T_CAMERA)[0]
    document = document_of(solution)
    assert document.verdict.accepted
    assert document.uncertainty is not None
    assert all(view.status == "corrected" for view in document.views)


TELLS_TOO_LITTLE = [
    (
        "turns about one axis",
        bumpy,
        [transform(rotation_from_vector([np.pi, 0, 0]), [5.0 * i, 0, 400]) for i in range(6)],
    ),
    ("a plane", flat, poses(4)[:3]),
    ("two views", bumpy, poses(2)),
]


@pytest.mark.parametrize(("why", "height", "flange"), TELLS_TOO_LITTLE, ids=[entry[0] for entry in TELLS_TOO_LITTLE])
def test_views_that_do_not_fix_x_give_none(tmp_path: Path, why: str, height: object, flange: list[Array]) -> None:
    part_scan(tmp_path, height, flange)
    document = document_of(solve_surface_scan(read_scan(tmp_path), ROUGH, NOISE))
    assert document.flange_T_camera is None
    assert not document.verdict.accepted


def test_views_apart_from_each_other_are_refused(tmp_path: Path) -> None:
    flange = poses(4)
    clouds = [view_of(bumpy, pose @ FLANGE_T_CAMERA, i, at=1000.0 * i) for i, pose in enumerate(flange)]
    write_scan(tmp_path, clouds, flange)
    solution = solve_surface_scan(read_scan(tmp_path), ROUGH)
    assert solution.mount_T_camera is None
    assert solution.findings[0].code == "views-alone"


@pytest.fixture(scope="module")
def began_near(real_data: Path) -> Callable[[str], Solution]:
    """The solution of the real scan of an object by its name, begun near X; each is computed once."""
    rough = solve_sphere_scan(read_scan(real_data / "reghec_sphere"), 48.37).mount_T_camera
    assert rough is not None
    return cache(lambda name: solve_surface_scan(read_scan(real_data / f"reghec_{name}"), rough))


@pytest.mark.data
def test_two_real_objects_give_the_same_x(began_near: Callable[[str], Solution]) -> None:
    one, two = (began_near(name).mount_T_camera for name in ("duck", "david"))
    assert one is not None
    assert two is not None
    translation_mm, rotation_rad = difference(one, two)
    assert translation_mm < 1.0
    assert rotation_rad < np.deg2rad(0.2)


@pytest.mark.data
@pytest.mark.parametrize("name", ["plane", "sphere"])
def test_real_planes_and_spheres_are_refused(name: str, real_data: Path) -> None:
    (finding,) = solve_surface_scan(read_scan(real_data / f"reghec_{name}"), None).findings
    assert finding.code == "surfaces-ambiguous" and "slides on itself" in finding.message


@pytest.mark.data
@pytest.mark.parametrize("name", ["cone", "cylinder", "david", "duck", "mozart"])
def test_real_objects_give_the_same_x_without_a_rough_one(
    name: str, real_data: Path, began_near: Callable[[str], Solution]
) -> None:
    near, searched = began_near(name), solve_surface_scan(read_scan(real_data / f"reghec_{name}"), None)
    assert near.mount_T_camera is not None
    assert searched.mount_T_camera is not None
    off_mm, off_rad = difference(near.mount_T_camera, searched.mount_T_camera)
    assert off_mm < 0.3
    assert off_rad < np.deg2rad(0.1)
    assert judge_scan(searched, STATED).accepted
