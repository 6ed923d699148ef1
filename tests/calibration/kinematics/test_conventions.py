"""Every convention against scipy in both directions, and the brands."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.documents.imports.pose_table import allowed_conventions, find_conventions, rotations_of
from calibration.errors import GeometryError
from calibration.kinematics.conventions import (
    BRANDS,
    CONVENTIONS,
    NUMBERS,
    numbers_of,
)
from calibration.transforms import rotation_from_vector

ANGLES = np.array([[10.0, 20.0, 30.0], [-170.0, 40.0, 95.0]])


@pytest.mark.parametrize("name", [name for name in CONVENTIONS if name.startswith("euler") and "rad" not in name])
def test_euler_angles_are_scipy_s(name: str) -> None:
    expected = Rotation.from_euler(name.removeprefix("euler-"), ANGLES, degrees=True).as_matrix()
    np.testing.assert_allclose(rotations_of(CONVENTIONS[name], ANGLES), expected, atol=1e-12)
    np.testing.assert_allclose(rotations_of(CONVENTIONS[f"{name}-rad"], np.radians(ANGLES)), expected, atol=1e-12)


def test_angles_named_by_axis_are_those_of_the_axes() -> None:
    given = rotations_of(CONVENTIONS["euler-ZYX"], ANGLES, by_axis=True)
    np.testing.assert_allclose(given, rotations_of(CONVENTIONS["euler-xyz"], ANGLES), atol=1e-12)


def test_kawasaki_s_angles_may_be_named_by_axis_and_stand_in_their_order() -> None:
    kawasaki = CONVENTIONS["euler-ZYZ"]
    assert kawasaki in allowed_conventions("angles", ANGLES, by_axis=True)
    np.testing.assert_array_equal(rotations_of(kawasaki, ANGLES, by_axis=True), rotations_of(kawasaki, ANGLES))


def test_the_other_kinds() -> None:
    rotation = rotation_from_vector([[0.1, -0.2, 0.3]])
    xyzw = Rotation.from_matrix(rotation).as_quat()
    for name, numbers in {
        "quaternion-xyzw": xyzw, "quaternion-wxyz": np.roll(xyzw, 1, axis=1), "matrix": rotation.reshape(1, 9),
        "matrix-columns": np.swapaxes(rotation, 1, 2).reshape(1, 9), "rotation-vector": np.array([[0.1, -0.2, 0.3]]),
        "rotation-vector-deg": np.degrees([[0.1, -0.2, 0.3]]),
    }.items():  # fmt: skip
        np.testing.assert_allclose(rotations_of(CONVENTIONS[name], numbers), rotation, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("name", [name for name, one in CONVENTIONS.items() if one.kind not in ("joints", "points")])
def test_what_is_written_in_a_convention_is_read_in_it(name: str) -> None:
    turned = rotation_from_vector([[0.1, -0.2, 0.3], [2.0, 1.0, -1.5], [0.0, 0.0, 0.0]])
    locked = Rotation.from_euler("ZYX", [[20.0, 90.0, 10.0], [-40.0, -90.0, 170.0], [30.0, 0.0, 50.0]], degrees=True)
    for rotation in [*turned, *locked.as_matrix()]:
        numbers = np.array(numbers_of(name, rotation))
        assert len(numbers) == NUMBERS[CONVENTIONS[name].kind]
        np.testing.assert_allclose(rotations_of(CONVENTIONS[name], numbers[None])[0], rotation, atol=1e-9)


@pytest.mark.parametrize("brand", BRANDS)
def test_a_brand_names_conventions_and_a_unit(brand: str) -> None:
    conventions, unit = find_conventions(brand)
    assert conventions
    assert unit in ("m", "mm")


@pytest.mark.parametrize(("brand", "formula"), [
    ("kuka", "KUKA_2_Pose"), ("fanuc", "Fanuc_2_Pose"), ("yaskawa", "Motoman_2_Pose"), ("ur", "UR_2_Pose"),
    ("staubli", "Staubli_2_Pose"), ("kawasaki", "Adept_2_Pose"),
])  # fmt: skip
def test_a_brand_is_robodk_s(brand: str, formula: str) -> None:
    robomath = pytest.importorskip("robodk.robomath")
    ((convention, *_), _) = find_conventions(brand)
    for numbers in ANGLES / 100 if brand == "ur" else ANGLES:
        expected = np.array(getattr(robomath, formula)([0, 0, 0, *numbers]).rows)[:3, :3]
        np.testing.assert_allclose(rotations_of(convention, numbers[None])[0], expected, atol=1e-9)


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(GeometryError, match="did you mean 'euler-ZYX'"):
        find_conventions("eulerZYX")


@pytest.mark.parametrize("numbers", [[[1.0, 0.1, 0, 0]], [[0.0, 0, 0, 0]]])
def test_what_is_no_rotation_is_refused(numbers: list[list[float]]) -> None:
    with pytest.raises(GeometryError, match="pose 1"):
        rotations_of(CONVENTIONS["quaternion-wxyz"], np.array(numbers))
