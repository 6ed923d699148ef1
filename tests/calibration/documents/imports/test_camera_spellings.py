"""Names and kinds of files by which public data hold a camera: all are read alike, or refused by the name."""

import io
import json
from typing import Any

import numpy as np
import pytest

from calibration.documents.imports.intrinsics import Intrinsics, read_intrinsics
from calibration.errors import DocumentError

K = [[600, 0, 320], [0, 601, 240], [0, 0, 1]]
D = [0.1, -0.2, 0.001, 0.002, 0.03]
BY_NAME = {"k1": 0.1, "k2": -0.2, "p1": 0.001, "p2": 0.002, "k3": 0.03}
FOUR = {"fx": 600, "fy": 601, "cx": 320, "cy": 240}
EQUI = [-0.03, 0.012, -0.006, 0.001]
BY_NAME_EQUI = dict(zip(("k1", "k2", "k3", "k4"), EQUI, strict=True))
REALSENSE = {"width": 640, "height": 480, "fx": 600, "fy": 601, "ppx": 320, "ppy": 240}


def read(data: Any) -> Intrinsics:
    return read_intrinsics("a.json", json.dumps(data).encode())


MATRICES = (
    "K mtx cameraMatrix camera_matrix CameraMatrix cam_matrix camMatrix intrinsic intrinsics Intrinsic intrinsic_matrix"
    " intrinsicMatrix camera_intrinsics color_intrinsics matrix cam_K"
)
DISTORTIONS = (
    "dist D d distCoeffs dist_coeffs dist_coeff dist_coef distCoef distCof distortion distortion_coefficients"
    " distortion_coeffs distortionCoeff DistortionCoefficients distortion_params lens_distortion coeffs kc k disto"
    " cam_dist camera_dist camera_dist_coeffs cam_dist_coeffs lens_coeffs color_coeffs opencv_dist cam_D"
)


@pytest.mark.parametrize("name", MATRICES.split())
def test_names_of_the_matrix(name: str) -> None:
    found = read({name: K, "dist": D})
    assert (found.matrix, found.distortion) == (tuple(map(tuple, K)), tuple(D))


def test_metrics_names_of_the_terms() -> None:
    names = ["dist_k0", "dist_k1", "dist_px", "dist_py", "dist_k2"]
    assert read({"camera_matrix": K, **dict(zip(names, D, strict=True))}).distortion[:5] == tuple(D)


@pytest.mark.parametrize("name", DISTORTIONS.split())
@pytest.mark.parametrize("matrix", ["camera_matrix", "K"])
def test_names_of_the_distortion(name: str, matrix: str) -> None:
    found = read({matrix: K, name: D})
    assert (found.distortion, found.has_distortion) == (tuple(D), True)


@pytest.mark.parametrize(
    "text",
    [
        "[0.1, -0.2, 0.001, 0.002, 0.03]",
        "0.1;-0.2; 0.001;0.002;0.03",
        "[[0.1 -0.2 1e-3 2e-3 .03]]",
        "array([[0.1, -0.2, 0.001, 0.002, 0.03]])",
        "{0.1, -0.2, 0.001, 0.002, 0.03}",
        "0.1|-0.2|0.001|0.002|0.03",
    ],
)
def test_distortion_as_text(text: str) -> None:
    assert read({"K": K, "distortion": text}).distortion == tuple(D)


@pytest.mark.parametrize("distance", [{"d": 0.3}, {"D": 0.3, "d": D}, {"dist": 500.0}, {"dist": 0.0}])
def test_a_number_is_no_distortion_but_a_distance(distance: dict[str, Any]) -> None:
    assert read({"K": K, "D": D} | distance).distortion == tuple(D)
    if not isinstance(distance.get("d"), list):
        np.testing.assert_array_equal(read({"K": K, **BY_NAME} | distance).distortion, [*D, 0, 0, 0])


FLAT = [float(one) for row in K for one in row]
ALIKE: dict[str, dict[str, Any]] = {
    "text": {"D": D, "d": "mm"},
    "model": {"distortion": D, "Distortion": "plumb_bob"},
    "model first": {"Distortion": "plumb_bob", "distortion": D},
    "nothing": {"d": None, "D": D},
    "nothing last": {"D": D, "d": None},
    "bool": {"D": D, "d": True},
    "empty": {"D": D, "d": []},
    "the same by other names": {"D": D, "dist_coeffs": [D], "coeffs": [*D, 0, 0, 0], **BY_NAME},
    "shape": {"D": D, "d": [D]},
    "matrix": {"D": D, "k_matrix": K, "K_matrix": FLAT},
    **{word: {"D": D, "distortion_type": word} for word in ("Brown", "radial", "standard", "OpenCV5", "rational")},
    "a number of a model": {"D": D, "dist_model": 5},
    "points": {"D": D, "s1": 3, "t1": 0.5, "t2": 0.7},
}


@pytest.mark.parametrize("case", ALIKE)
def test_a_list_counts_before_what_is_beside_it(case: str) -> None:
    found = read({"K": K} | ALIKE[case])
    assert (found.matrix, found.distortion, found.lens) == (tuple(map(tuple, K)), tuple(D), "pinhole")


BESIDE_FISHEYE = {
    "block": {"K": K, "D": D[:4], "fisheye": {"D": EQUI}},
    "siblings": {"pinhole": {"K": K, "D": D[:4]}, "fisheye": {"D": EQUI}},
    "siblings below a matrix": {"K": K, "pinhole": {"D": D[:4]}, "fisheye": {"D": EQUI}},
    "none": {"non_fisheye": {"K": K, "D": D[:4]}},
    "disabled": {"K": K, "D": D[:4], "fisheye": {"enabled": False, "k1": 0}},
    "disabled, with coefficients": {"K": K, "D": D[:4], "fisheye": {"enabled": "no", "D": EQUI}},
}


@pytest.mark.parametrize("case", BESIDE_FISHEYE)
def test_a_pinhole_beside_a_fisheye(case: str) -> None:
    found = read(BESIDE_FISHEYE[case])
    assert (found.lens, found.distortion) == ("pinhole", tuple(D[:4]))


PINHOLE = {
    "RealSense": REALSENSE | {"model": "distortion.brown_conrady", "coeffs": D},
    "RealSense, modified": REALSENSE | {"model": "Modified Brown Conrady", "coeffs": D},
    "RealSense, none": REALSENSE | {"model": "distortion.none", "coeffs": [0.0] * 5},
    "RealSense, inverse of nothing": REALSENSE | {"model": "distortion.inverse_brown_conrady", "coeffs": [0] * 5},
    "RealSense, 1": REALSENSE | {"model": 1, "coeffs": D},
    "RealSense, 2 of nothing": REALSENSE | {"model": 2, "coeffs": [0] * 5},
    "RealSense, 3 of nothing": REALSENSE | {"model": 3, "coeffs": [0] * 5},
    "RealSense, 4": REALSENSE | {"distortion_model": 4, "coeffs": D},
    "nerfstudio": {"camera_model": "OPENCV", "fl_x": 600, "fl_y": 601, "cx": 320, "cy": 240, "w": 640, "h": 480,
                   **BY_NAME},
    "ORB-SLAM": {f"Camera.{key}": one for key, one in {**FOUR, **BY_NAME, "width": 640, "height": 480}.items()},
    "a product's name": {**FOUR, "model": "acA2440-75um", "type": "camera", "dist": D, "width": 640, "height": 480},
}  # fmt: skip


@pytest.mark.parametrize("case", PINHOLE)
def test_pinhole_cameras(case: str) -> None:
    found, data = read(PINHOLE[case]), PINHOLE[case]
    wanted = [0.0] * 5 if not any(data.get("coeffs", D)) else D
    assert (found.lens, found.image_size, found.matrix) == ("pinhole", (640, 480), tuple(map(tuple, K)))
    np.testing.assert_array_equal(found.distortion, wanted + [0.0] * (len(found.distortion) - 5))


FISHEYES = {
    "model": {"camera_matrix": K, "dist_coeffs": EQUI, "model": "fisheye"},
    "camera_model beside a pinhole": {"K": K, "D": EQUI, "camera_model": "pinhole", "model": "fisheye"},
    "a flag": {"camera_matrix": K, "dist_coeffs": EQUI, "fisheye": True},
    "a flag in words": {"camera_matrix": K, "dist_coeffs": EQUI, "use_fisheye": "yes"},
    "a flag of 1": {**FOUR, "dist": EQUI, "is_fisheye": 1},
    "RealSense": REALSENSE | {"model": "distortion.kannala_brandt4", "coeffs": [*EQUI, 0.0]},
    "RealSense, 5": REALSENSE | {"model": 5, "coeffs": [*EQUI, 0.0]},
    **{key: {**FOUR, key: "equidistant", "dist": EQUI} for key in
       ["distortion_type", "distortionType", "dist_model", "lens_type", "projection", "projection_model",
        "model_name"]},
    "enabled": {"K": K, "D": EQUI, "fisheye": {"enabled": True}},
    "enabled beside a pinhole": {"K": K, "fisheye": {"enabled": True, "D": EQUI}, "camera_model": "pinhole"},
    "the camera deep within fisheye": {"fisheye": {"left": {"K": K, "D": EQUI}}},
    "within fisheye": {"fisheye": {"K": K, "D": EQUI}},
    "within fisheye_camera": {"fisheye_camera": {"K": K, "D": EQUI}},
    "coefficients within fisheye": {"K": K, "fisheye": {"D": EQUI}},
    "Kannala Brandt4": {**FOUR, "distortion_model": "Kannala Brandt4", "dist": EQUI},
    "nerfstudio": {**FOUR, "camera_model": "OPENCV_FISHEYE", **BY_NAME_EQUI},
    "ORB-SLAM3": {"Camera.type": "KannalaBrandt8"}
    | {f"Camera1.{key}": one for key, one in {**FOUR, **BY_NAME_EQUI}.items()},
}  # fmt: skip


@pytest.mark.parametrize("case", FISHEYES)
def test_fisheyes(case: str) -> None:
    found = read(FISHEYES[case])
    assert (found.lens, found.distortion) == ("fisheye", tuple(EQUI))


@pytest.mark.parametrize("fisheye", [{}, {"k1": 0}, {"D": EQUI}, {"model": "equidistant"}])
def test_a_fisheye_that_is_disabled_is_as_good_as_none(fisheye: dict[str, Any]) -> None:
    found = read({"K": K, "fisheye": {"enabled": False, **fisheye}})
    assert (found.lens, found.distortion, found.has_distortion) == ("pinhole", (0.0,) * 5, False)


@pytest.mark.parametrize("flag", [False, 0, "no"])
def test_a_flag_that_is_not_set(flag: Any) -> None:
    assert read({"K": K, "dist": EQUI, "fisheye": flag}).lens == "pinhole"


REFUSED = {
    "k1 to k4 without a model": ({**FOUR, **BY_NAME_EQUI}, "add camera_model: fisheye or pinhole"),
    "RealSense, inverse": (REALSENSE | {"model": "distortion.inverse_brown_conrady", "coeffs": D}, "inverse_brown"),
    "RealSense, f-theta": (REALSENSE | {"model": "distortion.ftheta", "coeffs": D}, "'distortion.ftheta' is not read"),
    "a fisheye with p1": ({**FOUR, "model": "fisheye", **BY_NAME}, "coefficients"),
    "RealSense, 2": (REALSENSE | {"model": 2, "coeffs": D}, "inverse_brown"),
    "RealSense, 3": (REALSENSE | {"model": 3, "coeffs": D}, "ftheta"),
    "OCamCalib": ({"K": K, "dist": D, "model": "OCamCalib"}, "ocamcalib"),
    **{key: ({"cam_mtx": K, key: D}, "distortion that is not read") for key in
       ("camera_coefficients", "coefs", "dst", "D0", "numbers")},
    **{key: ({**FOUR, **BY_NAME, key: 0.01}, f"{key}: distortion that is not read") for key in
       ("k0", "k7", "p3", "s1", "s4", "t1", "t2")},
    "a fisheye with k5": ({**FOUR, "model": "fisheye", **BY_NAME_EQUI, "k5": 0.1}, "coefficients"),
    "only a number": ({"K": K, "d": 0.3}, "d: distortion that is not read"),
    "two that differ": ({"K": K, "D": D, "d": EQUI}, "d: distortion that is not read"),
    "two cameras of ORB-SLAM": ({f"Camera{at}.{key}": one + at for at in (1, 2) for key, one in FOUR.items()},
                                "several cameras"),
    "a list of one that differs": ({"K": K, "D": D, "d": [0.1]}, "d: distortion that is not read"),
    "two names that differ": ({"K": K, "D": D, "coeffs": EQUI}, "coeffs: other coefficients than by another name"),
    "a list and names that differ": ({"K": K, "D": D, "k1": 0.2, "k2": 0.1}, "k1: other coefficients"),
    "ViSP's with a fisheye": ({**FOUR, "model": "fisheye", "kud": 0.1}, "kud: distortion that is not read"),
    "unknown name": ({"K": K, "dist_co": D}, "distco: distortion that is not read"),
    "name with distortion in it": ({"K": K, "my_distortion_of_lens": D}, "mydistortionoflens: distortion that"),
    "as text": ({"K": K, "dist_co": "0.1, -0.2, 0, 0"}, "distco: distortion that is not read"),
    "k is no number": ({"camera_matrix": K, "k": [0.1, ".Nan", 0, 0]}, "k: distortion that is not read"),
    **{f"{name} of {len(k)} beside {' and '.join(p)}": ({**FOUR, name: k, **p}, "p1 and p2: beside coefficients") for
       name, k, p in (("k", [0.1, -0.2], {"p": [1e-3, 2e-3]}), ("d", [0.1, -0.2], {"p": [1e-3, 2e-3]}),
                      ("k", [0.1, -0.2, 0.03, 0, 0, 0], {"p1": 1e-3, "p2": 2e-3}))},
    "tangential beside radial": ({**FOUR, "k1": 0.1, "k2": -0.2, "tangential": [0.001, 0.002]}, "tangential: dist"),
    "as text with names": ({"K": K, "dist": "k1=0.1 k2=-0.2"}, "dist: distortion that is not read"),
    "around the camera": ({"calib": {"K": K}, "dst": D}, "dst: distortion that is not read"),
    "in a lens beside": ({"K": K, "lens_params": {"numbers": D}}, "numbers: distortion that is not read"),
    "HALCON's polynomial": ({"K": K, "D": D, "dist_model": "Polynomial"}, "polynomial"),
    "nine numbers": ({"K": K, "dist": [0.1] * 9}, "dist: distortion that is not read"),
}  # fmt: skip


@pytest.mark.parametrize(
    "beside",
    [
        "P",
        "projection_matrix",
        "quaternion",
        "roi",
        "extrinsics",
        "qvec",
        "q",
        "xyzw",
        "background",
        "timestamps",
        "depth_range",
        "hand_eye",
    ],
)
def test_lists_that_are_no_distortion(beside: str) -> None:
    assert not read({"K": K, beside: [0.1, 0.2, 0.3, 0.4]}).has_distortion


@pytest.mark.parametrize(
    "one", [np.full((3, 4), 0.5).tolist(), [0, 1, 2, 3, 5], "2024 01 02 03", [600.0, 601.0, 320.0, 240.0], [0.5] * 6]
)
def test_lists_whose_numbers_are_no_distortion(one: Any) -> None:
    assert not read({"K": K, "one": one}).has_distortion
    assert not read({"camera": {"K": K}, "lens": {"one": one}}).has_distortion


def test_zeros_of_an_unknown_name() -> None:
    assert read({"K": K, "dst": [0.0] * 5}).distortion == (0.0,) * 5


@pytest.mark.parametrize("case", REFUSED)
def test_a_distortion_that_is_not_understood_is_never_none(case: str) -> None:
    data, what = REFUSED[case]
    with pytest.raises(DocumentError, match=what):
        read(data).document((640, 480))


def npz(**arrays: Any) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def npy(array: Any) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


FILES = {
    "mtx and dist": ("a.npz", npz(ret=0.2, mtx=K, dist=[D], rvecs=np.ones((9, 3, 1)), tvecs=np.ones((9, 3, 1))), D),
    "cam_mtx and cam_dist": ("a.npz", npz(cam_mtx=K, cam_dist=[D]), D),
    "K and D": ("a.npz", npz(K=K, D=np.array(D)[:, None]), D),
    "camera_matrix and dist_coeffs": ("a.npz", npz(camera_matrix=K, dist_coeffs=D), D),
    "beside a picture": ("a.npz", npz(K=K, D=D, picture=np.zeros((480, 640, 3), np.uint8)), D),
    "matrix alone": ("K.npy", npy(np.array(K, float)), [0.0] * 5),
    "np.savetxt": ("K.txt", b"6.0e+02 0.0 3.2e+02\n0.0 6.01e+02 2.4e+02\n0.0 0.0 1.0\n", [0.0] * 5),
    "np.savetxt with commas": ("K.csv", b"# K\n600,0,320\n0,601,240\n0,0,1\n", [0.0] * 5),
    "a list alone": ("K.json", json.dumps(K).encode(), [0.0] * 5),
}


@pytest.mark.parametrize("case", FILES)
def test_files_of_numbers(case: str) -> None:
    name, content, distortion = FILES[case]
    found = read_intrinsics(name, content)
    assert (found.matrix, found.distortion) == (tuple(map(tuple, K)), tuple(distortion))


REFUSED_FILES = {
    "objects": ("a.npz", npz(K=np.array([{"fx": 1}], object)), "no array of numpy, or no numbers"),
    "no camera": ("a.npz", npz(a=np.eye(4)), "no intrinsics"),
    "a vector": ("a.npy", npy(np.arange(5.0)), "no intrinsics"),
    "no archive": ("a.npz", b"PK", "no .npz file"),
    "HALCON": ("campar.dat", b"# INTERNAL\nParGroup: Cam: Par;\n 'Focus': 0.008;\n", "leave them out"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED_FILES)
def test_files_that_are_refused(case: str) -> None:
    name, content, what = REFUSED_FILES[case]
    with pytest.raises(DocumentError, match=what):
        read_intrinsics(name, content)
