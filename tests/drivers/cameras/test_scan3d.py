"""Coordinates of 3D cameras in mm, by the rules of GenICam SFNC 2.7, chapter "3D Scan Control".

No producer that can be installed serves coordinates (EMVA's viky.cti has RGBa8 and Mono8): the numbers are written
here. The projection is that of the features' descriptions, as in Photoneo's GenICam documentation of ProjectedC.
"""

import numpy as np
import pytest

from drivers.cameras.genicam.device import RawPicture
from drivers.cameras.genicam.scan3d import Coordinate, Scan3d, points_of, read_scan3d
from drivers.errors import GarbledAnswer, IncompletePicture, SettingRefused

ABC32F, ABC16, C16, C32F = 0x026000C0, 0x023000B9, 0x011000B8, 0x012000BF
PLAIN = (Coordinate(), Coordinate(), Coordinate())


def picture(numbers, code, padding=0):
    """A buffer of numbers (h, w[, 3]), with bytes of rubbish after each row."""
    height, width = numbers.shape[:2]
    rows = np.ascontiguousarray(numbers).view(np.uint8).reshape(height, -1)
    padded = np.hstack([rows, np.full((height, padding), 0xA5, np.uint8)])
    return RawPicture(padded.reshape(-1), code, width, height, padding)


def test_length_is_scale_times_number_plus_offset_for_each_axis():
    numbers = np.array([[[0, 100, 2000], [10, 200, 3000]]], "<u2")
    axes = (Coordinate(0.5, -3.0), Coordinate(0.1, 0.0), Coordinate(0.2, 100.0))
    for unit_mm in (1.0, 25.4):
        points = points_of("c", Scan3d(axes, unit_mm=unit_mm), picture(numbers, ABC16, padding=2))
        assert points == pytest.approx(unit_mm * np.array([[[-3.0, 10.0, 500.0], [2.0, 20.0, 700.0]]]))


@pytest.mark.parametrize(("axes", "absent"), [
    (PLAIN, [False, False, False, True]),
    ((Coordinate(), Coordinate(), Coordinate(invalid=0.0)), [True, False, False, True]),
    ((Coordinate(invalid=0.0), Coordinate(invalid=0.0), Coordinate()), [True, False, False, True]),
    ((Coordinate(), Coordinate(), Coordinate(limits=(100.0, 600.0))), [True, True, False, True]),
])  # fmt: skip
def test_a_pixel_without_a_point_is_nan(axes, absent):
    numbers = np.array([[[0, 0, 0], [0, 5, 700], [1, 2, 500], [1, np.nan, 500]]], "<f4")
    points = points_of("c", Scan3d(axes), picture(numbers, ABC32F))
    assert np.isnan(points).all(axis=2).tolist() == [absent]


@pytest.mark.parametrize(("code", "dtype"), [(C16, "<u2"), (C32F, "<f4")])
def test_depth_is_projected_by_the_lens(code, dtype):
    """Depth of points on a plane, by the pinhole model: the points come back."""
    focal_px, aspect, u_px, v_px = 500.0, 1.02, 3.5, 2.0
    axis = Coordinate(0.25, invalid=0.0)
    depth = np.array([[4000, 0, 2000], [1000, 3000, 8000]], dtype)
    settings = Scan3d((Coordinate(), Coordinate(), axis), "ProjectedC", 1.0, focal_px, aspect, (u_px, v_px))
    points = points_of("c", settings, picture(depth, code))
    assert np.isnan(points[0, 1]).all()
    seen = points[~np.isnan(points[..., 2])].astype(np.float64)
    rows, columns = np.nonzero(depth)
    assert seen[:, 2] == pytest.approx(0.25 * depth[depth > 0])
    assert focal_px * seen[:, 0] / seen[:, 2] + u_px == pytest.approx(columns, abs=1e-6)
    assert focal_px * aspect * seen[:, 1] / seen[:, 2] + v_px == pytest.approx(rows, abs=1e-6)


@pytest.mark.parametrize(("words", "lens", "says"), [
    ({"Scan3dOutputMode": "UncalibratedC"}, (0.0, 1.0, 0.0, 0.0), "UncalibratedC"),
    ({"Scan3dOutputMode": "ProjectedC"}, (0.0, 1.0, 0.0, 0.0), "no focal length"),
    ({"Scan3dCoordinateSystem": "Spherical"}, (0.0, 1.0, 0.0, 0.0), "Spherical"),
    ({"Scan3dDistanceUnit": "Pixel"}, (0.0, 1.0, 0.0, 0.0), "Pixel"),
])  # fmt: skip
def test_what_has_no_place_in_mm_is_refused(words, lens, says):
    with pytest.raises(SettingRefused, match=says):
        read_scan3d("c", words, PLAIN, lens)


def test_a_torn_or_foreign_buffer_is_no_cloud():
    whole = picture(np.zeros((4, 5, 3), "<f4"), ABC32F)
    torn = RawPicture(whole.data[:-1], ABC32F, 5, 4)
    with pytest.raises(IncompletePicture, match="239 bytes of a cloud came, 240"):
        points_of("c", Scan3d(PLAIN), torn)
    with pytest.raises(GarbledAnswer, match="does not go with"):
        points_of("c", Scan3d(PLAIN), picture(np.zeros((4, 5), "<u2"), C16))
