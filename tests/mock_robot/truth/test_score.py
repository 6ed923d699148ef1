"""The score is zero for the truth and says the size of an error that was put in."""

import numpy as np
import pytest

from calibration.transforms import Array, map_points, rotation_from_vector, transform
from mock_robot.scene.part import DOOR, surface_samples
from mock_robot.scene.scanner_view import cloud_ply
from mock_robot.truth.score import UnreadablePly, Unscorable, read_points, score_calibration, score_cloud
from mock_robot.truth.truth import CellTruth

TRUTH = CellTruth.from_seed(7)


def cloud(points_part: Array) -> bytes:
    return cloud_ply(map_points(TRUTH.base_T_part, points_part).astype(np.float32))


def test_the_skin_itself_scores_zero_and_is_covered() -> None:
    score = score_cloud(TRUTH, cloud(surface_samples(4.0)))
    assert score["rms_mm"] < 1e-3
    assert score["covered"] == 1.0
    assert score["stray"] == 0.0


def test_a_cloud_lifted_off_the_skin_scores_by_how_much() -> None:
    metal = surface_samples(6.0)
    metal = metal[DOOR.edge_distance(metal[:, 0], metal[:, 1]) < -5.0]
    score = score_cloud(TRUTH, cloud(metal + 0.3 * DOOR.normal(metal[:, 0], metal[:, 1])))
    for name in ("rms_mm", "mean_mm", "p95_mm", "max_mm"):
        assert score[name] == pytest.approx(0.3, abs=1e-3)


def test_half_the_door_covers_half() -> None:
    metal = surface_samples(5.0)
    left = metal[:, 0] < 0
    score = score_cloud(TRUTH, cloud(metal[left]))
    assert score["covered"] == pytest.approx(np.mean(left), abs=0.02)


def test_stray_and_missing_points_are_counted() -> None:
    metal = surface_samples(6.0)
    metal[:100] += [0.0, 0.0, 50.0]
    metal[100:150] = np.nan
    score = score_cloud(TRUTH, cloud(metal))
    assert score["not_finite"] == 50
    assert score["stray"] == pytest.approx(100 / (len(metal) - 50), rel=0.01)


def test_a_large_cloud_is_scored_on_an_even_selection() -> None:
    metal = np.tile(surface_samples(4.0), (8, 1))
    score = score_cloud(TRUTH, cloud(metal))
    assert score["points"] == len(metal)
    assert 100_000 <= score["scored"] <= 200_000


def test_a_cloud_without_points_cannot_be_scored() -> None:
    with pytest.raises(Unscorable, match="no finite point"):
        score_cloud(TRUTH, cloud(np.full((3, 3), np.nan)))


def test_the_true_calibration_has_no_error() -> None:
    assert set(score_calibration(TRUTH, TRUTH.flange_T_camera).values()) == {0.0}


def test_a_shifted_calibration_maps_every_point_off_by_the_shift() -> None:
    shifted = transform(np.eye(3), [0.3, 0.0, 0.4]) @ TRUTH.flange_T_camera
    score = score_calibration(TRUTH, shifted)
    for name in ("translation_mm", "point_rms_mm", "point_max_mm"):
        assert score[name] == pytest.approx(0.5)
    assert score["rotation_deg"] == pytest.approx(0.0, abs=1e-6)


def test_a_turned_calibration_errs_by_angle_times_distance() -> None:
    angle = np.radians(0.1)
    turned = TRUTH.flange_T_camera @ transform(rotation_from_vector([angle, 0.0, 0.0]), np.zeros(3))
    score = score_calibration(TRUTH, turned, distance_mm=600.0)
    assert score["rotation_deg"] == pytest.approx(0.1)
    assert score["point_rms_mm"] == pytest.approx(angle * 610.0, rel=0.02)


TWO = b"ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty char x\nproperty char y\nproperty char z\n"
MIXED = (
    b"ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty uchar red\nproperty double x\n"
    b"property float y\nproperty short z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"
)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (TWO + b"end_header\n" + bytes([1, 2, 3, 4, 5, 6]), [[1, 2, 3], [4, 5, 6]]),
        (MIXED + np.array([(9, 1.5, 2.5, -3)], ">u1,>f8,>f4,>i2").tobytes(), [[1.5, 2.5, -3]]),
    ],
    ids=["little endian", "big endian with colour"],
)
def test_other_ply_files_are_read(content: bytes, expected: list[list[float]]) -> None:
    assert read_points(content).tolist() == expected


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "PLY header"),
        (b"solid door\n", "PLY header"),
        (b"ply\nend_header\n", "no binary format"),
        (TWO + b"end_header\n" + bytes(3), "ends after 1"),
        (TWO.replace(b"char z", b"char w") + b"end_header\n", "x, y and z"),
        (TWO.replace(b"vertex 2", b"vertex many") + b"end_header\n", "how many"),
        (TWO.replace(b"binary_little_endian", b"ascii") + b"end_header\n1 2 3\n4 5 6\n", "no binary format"),
    ],
)
def test_what_is_no_cloud_is_refused(content: bytes, words: str) -> None:
    with pytest.raises(UnreadablePly, match=words):
        read_points(content)
