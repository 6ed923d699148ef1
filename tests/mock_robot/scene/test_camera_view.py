"""The rendered picture agrees with the camera's projection, checked without any of the renderer's own code."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.targets import AprilTagGrid, Charuco, Chessboard, CircleGrid, Target
from calibration.transforms import Array, map_points, rotation_from_vector, transform
from mock_robot.scene.camera_view import facing, render, scene_reflectance
from mock_robot.scene.optics import CLEAN, Optics
from mock_robot.scene.printed_target import print_target

STRONG = CameraModel(
    np.array([[1300.0, 0.0, 640.3], [0.0, 1301.0, 480.7], [0.0, 0.0, 1.0]]),
    np.array([-0.35, 0.15, 2e-3, -1e-3, -0.03]),
    (1280, 960),
)
PLAIN = CameraModel(np.array([[800.0, 0.0, 319.5], [0.0, 800.0, 239.5], [0.0, 0.0, 1.0]]), np.zeros(5), (640, 480))
BOARD = Chessboard(7, 5, 25.0)
KINDS: dict[str, Target] = {
    "chessboard": BOARD,
    "charuco": Charuco(8, 6, 20.0, 15.0, "DICT_5X5_100"),
    "legacy charuco": Charuco(8, 6, 20.0, 15.0, "DICT_6X6_250", legacy=True),
    "circles": CircleGrid("symmetric", 7, 6, 25.0, "black", "large-dot"),
    "white asymmetric circles": CircleGrid("asymmetric", 4, 9, 40.0, "white"),
    "apriltags": AprilTagGrid(4, 3, 30.0, 9.0),
}


def poses(count: int, seed: int = 3) -> list[Array]:
    """camera_T_target of boards tilted up to 35 degrees about two axes and turned at will."""
    rng = np.random.default_rng(seed)
    tilts = np.column_stack([rng.uniform(-0.6, 0.6, (count, 2)), rng.uniform(-3.1, 3.1, count)])
    places = np.column_stack([rng.uniform(-40, 40, count), rng.uniform(-30, 30, count), rng.uniform(280, 450, count)])
    middle = transform(np.eye(3), [-75.0, -50.0, 0.0])
    return [transform(rotation_from_vector(tilt), place) @ middle for tilt, place in zip(tilts, places, strict=True)]


def clean_picture(camera: CameraModel, target: Target, camera_T_target: Array) -> Array:
    rng = np.random.default_rng(0)
    return scene_reflectance(camera, print_target(target), camera_T_target, CLEAN, rng).astype(float)


def edge_errors(picture: Array, camera: CameraModel, camera_T_target: Array) -> list[float]:
    """Along a pixel row or column across an edge, the dark share must end where the projected edge crosses it."""
    v, u = (axis.ravel() for axis in np.mgrid[0:4, 0:7])
    middles = np.column_stack([25.0 * u, 25.0 * v + 12.5, np.zeros(u.size)])
    along = np.array([0.0, 0.5, 0.0])
    at, before, after = (
        camera.project(map_points(camera_T_target, p)) for p in (middles, middles - along, middles + along)
    )
    errors = []
    for pixel, direction in zip(at, after - before, strict=True):
        across = 0 if abs(direction[1]) > abs(direction[0]) else 1
        index = round(pixel[1 - across])
        crossing = pixel[across] + direction[across] / direction[1 - across] * (index - pixel[1 - across])
        line = picture[index] if across == 0 else picture[:, index]
        first = round(crossing) - 6
        window = line[first : first + 13]
        assert abs(window[-1] - window[0]) == pytest.approx(1.0, abs=1e-6), "the window must span one edge"
        errors.append(first - 0.5 + np.sum((window[-1] - window) / (window[-1] - window[0])) - crossing)
    return errors


@pytest.mark.slow
def test_edges_lie_where_the_camera_projects_them_at_twenty_poses_under_strong_distortion() -> None:
    errors = np.concatenate([edge_errors(clean_picture(STRONG, BOARD, pose), STRONG, pose) for pose in poses(20)])

    assert len(errors) == 20 * 28
    assert np.abs(errors).max() < 5e-4
    assert abs(errors.mean()) < 5e-5


def test_the_edge_check_notices_a_camera_that_is_half_a_pixel_off() -> None:
    pose = poses(1)[0]
    shifted = replace(STRONG, matrix=STRONG.matrix + np.array([[0, 0, 0.5], [0, 0, 0], [0, 0, 0]]))

    assert np.abs(edge_errors(clean_picture(shifted, BOARD, pose), STRONG, pose)).max() > 0.2


def test_pixel_zero_is_the_centre_of_the_first_pixel() -> None:
    """A sheet's edge projected onto the pixel boundary -0.5 + k leaves whole pixels; onto a centre, halves one."""
    board = Chessboard(2, 2, 100.0)
    for column, expected in ((99.5, (1.0, 0.0)), (100.0, (1.0, 0.5)), (100.25, (1.0, 0.75))):
        x_mm = (column - 319.5) * 800.0 / 800.0
        picture = clean_picture(PLAIN, board, transform(np.eye(3), [x_mm, -50.0, 800.0]))
        assert picture[200, 99:101] == pytest.approx(expected, abs=1e-4), "white left of the edge, black right of it"


def test_a_dot_has_the_centroid_of_its_projected_disc_and_not_its_projected_centre() -> None:
    dots = CircleGrid("symmetric", 3, 2, 60.0)
    pose = transform(rotation_from_vector([0.9, 0.2, 0.3]), [-40.0, -30.0, 260.0])
    picture = 1.0 - clean_picture(STRONG, dots, pose)
    y, x = np.indices(picture.shape)
    centres_px = STRONG.project(map_points(pose, dots.points_mm))
    for centre_mm, centre_px in zip(dots.points_mm, centres_px, strict=True):
        disc_px = STRONG.project(map_points(pose, disc(centre_mm, 15.0)))
        inside = (np.abs(x - centre_px[0]) < 130) & (np.abs(y - centre_px[1]) < 100)
        inside &= np.hypot(x - centre_px[0], y - centre_px[1]) < np.ptp(disc_px, axis=0).max() / 2 + 6
        weight = picture * inside
        centroid = np.array([np.sum(weight * x), np.sum(weight * y)]) / weight.sum()
        expected, area = polygon_centroid(disc_px)
        assert centroid == pytest.approx(expected, abs=2e-3)
        assert weight.sum() == pytest.approx(area, rel=2e-4)
        assert np.linalg.norm(expected - centre_px) > 0.3, "this view must have an ellipse's bias to tell apart"


def disc(centre_mm: Array, radius_mm: float) -> Array:
    angle = np.linspace(0, 2 * np.pi, 3601)[:-1]
    return centre_mm + radius_mm * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(angle.size)])


def polygon_centroid(corners: Array) -> tuple[Array, float]:
    """Of a fine polygon, by the shoelace formula."""
    (x, y), (x_next, y_next) = corners.T, np.roll(corners, -1, axis=0).T
    cross = x * y_next - x_next * y
    area = cross.sum() / 2
    return np.array([np.sum((x + x_next) * cross), np.sum((y + y_next) * cross)]) / (6 * area), abs(area)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_agrees_with_brute_force_sampling(kind: str) -> None:
    """16 × 16 points a pixel, each sent through the camera's own inverse."""
    target = KINDS[kind]
    sheet = print_target(target)
    pose = transform(rotation_from_vector([0.3, -0.4, 0.2]), [0.0, 0.0, 420.0]) @ transform(
        np.eye(3), [*-sheet.outline_mm.mean(axis=0), 0.0]
    )
    picture = clean_picture(STRONG, target, pose)
    rng = np.random.default_rng(1)
    pixels = STRONG.project(
        map_points(pose, np.column_stack([rng.uniform(*sheet.outline_mm[[0, 2]], (400, 2)), np.zeros(400)]))
    )
    pixels = np.rint(pixels).astype(int)
    steps = (np.arange(16) + 0.5) / 16 - 0.5
    samples = pixels[:, None] + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(1, -1, 2)
    rays = STRONG.normalise(samples.reshape(-1, 2))
    u, v, w = np.linalg.inv(pose[:3, [0, 1, 3]]) @ np.column_stack([rays, np.ones(len(rays))]).T
    truth = np.nan_to_num(sheet.reflectance(u / w, v / w), nan=0.35).reshape(len(pixels), -1).mean(axis=1)

    difference = picture[pixels[:, 1], pixels[:, 0]] - truth
    assert np.abs(difference).max() < 0.04, "what 16 × 16 samples cannot resolve"
    assert abs(difference.mean()) < 2e-3
    assert np.any((truth > 0.05) & (truth < 0.95)), "some pixels must lie on edges"


def test_pixels_at_a_turned_corner_have_their_share_of_both_edges() -> None:
    """Multiplying the two edges' shares, as if they were independent, would be off by up to 0.1 here."""
    steps = (np.arange(64) + 0.5) / 64 - 0.5
    dx, dy = np.meshgrid(steps, steps)
    board = Chessboard(2, 2, 100.0)
    for corner_x, corner_y in ((320.0, 240.0), (320.3, 240.1), (319.8, 240.4), (320.45, 239.6)):
        place = [corner_x - 319.5, corner_y - 239.5, 800.0]
        picture = clean_picture(PLAIN, board, transform(rotation_from_vector([0.0, 0.0, 0.7]), place))
        for row in (239, 240, 241):
            for column in (319, 320, 321):
                x, y = column + dx - corner_x, row + dy - corner_y
                u, v = np.cos(0.7) * x + np.sin(0.7) * y, np.cos(0.7) * y - np.sin(0.7) * x
                assert picture[row, column] == pytest.approx(np.mean((u < 0) != (v < 0)), abs=0.01)


def test_a_target_behind_the_camera_or_beside_the_picture_leaves_its_surroundings() -> None:
    for place in ([0.0, 0.0, -400.0], [5000.0, 0.0, 400.0], [0.0, -3000.0, 10.0]):
        assert np.all(clean_picture(STRONG, BOARD, transform(np.eye(3), place)) == np.float32(0.35))


def test_a_target_through_the_camera_plane_is_drawn_where_it_is_in_front_only() -> None:
    """Its far side would show mirrored above the horizon if rays were followed backwards."""
    board = Chessboard(7, 5, 100.0)
    steep = transform(rotation_from_vector([1.35, 0.0, 0.0]), [-300.0, -40.0, -100.0])
    picture = clean_picture(STRONG, board, steep)
    y, x = (axis.ravel() for axis in np.mgrid[3:960:7, 3:1280:7])
    rays = STRONG.normalise(np.column_stack([x, y]).astype(float))
    u, v, w = np.linalg.inv(steep[:3, [0, 1, 3]]) @ np.column_stack([rays, np.ones(len(rays))]).T
    on_plane = np.where(w > 0, print_target(board).reflectance(u / w, v / w), np.nan)
    ghosts = np.isfinite(print_target(board).reflectance(u / w, v / w)) & (w < 0)

    assert ghosts.sum() > 100, "this view must be able to show a ghost"
    assert np.isfinite(on_plane).sum() > 1000
    agrees = np.abs(picture[y, x] - np.nan_to_num(on_plane, nan=0.35)) < 1e-6
    assert agrees.mean() > 0.97, "all but the pixels on edges"
    assert np.all(picture[y, x][ghosts] == np.float32(0.35))


def test_small_dots_have_their_whole_area() -> None:
    """Edges taken as straight across a whole pixel would lose 1 / (12 radius squared) of it."""
    dots = CircleGrid("symmetric", 6, 5, 20.0)
    for distance in (800.0, 1300.0):
        pose = transform(np.eye(3), [-50.3, -40.1, distance])
        dark = (1.0 - clean_picture(PLAIN, dots, pose)) * (clean_picture(PLAIN, dots, pose) != np.float32(0.35))
        outline = print_target(dots).outline_mm
        left, top, right, bottom = np.rint(
            PLAIN.project(map_points(pose, np.column_stack([outline, np.zeros(4)])))[[0, 2]].ravel()
        ).astype(int)
        radius_px = 5.0 * 800.0 / distance
        assert dark[top + 3 : bottom - 2, left + 3 : right - 2].sum() == pytest.approx(
            30 * np.pi * radius_px**2, rel=1e-3
        )


def test_a_part_of_the_target_outside_the_picture_does_not_move_the_rest() -> None:
    pose = transform(rotation_from_vector([0.2, -0.3, 0.4]), [-250.0, -30.0, 380.0])
    picture = clean_picture(STRONG, BOARD, pose)
    wide = replace(
        STRONG, matrix=STRONG.matrix + np.array([[0, 0, 400.0], [0, 0, 300.0], [0, 0, 0]]), image_size=(2080, 1560)
    )
    assert np.abs(picture - clean_picture(wide, BOARD, pose)[300:1260, 400:1680]).max() < 2e-5


def test_the_back_of_a_sheet_is_blank() -> None:
    from_behind = transform(rotation_from_vector([0.0, np.pi, 0.0]), [75.0, -50.0, 400.0])
    picture = clean_picture(STRONG, BOARD, from_behind)
    assert picture.min() > 0.3
    assert picture.max() == pytest.approx(0.9, abs=1e-6)


def test_the_same_seed_gives_the_same_picture_and_another_seed_other_noise() -> None:
    pose = poses(1)[0]
    first, again, other = (render(STRONG, BOARD, pose, Optics(), np.random.default_rng(s)) for s in (1, 1, 2))
    assert first.dtype == np.uint8
    assert first.shape == (960, 1280)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_smeared_picture_is_the_mean_of_its_moments() -> None:
    pose = facing(400.0, print_target(BOARD))
    moved = transform(np.eye(3), [3.0, 0.0, 0.0]) @ pose
    smeared = render(STRONG, BOARD, np.array([pose, moved]), CLEAN, np.random.default_rng(1)).astype(float)
    first, second = (render(STRONG, BOARD, p, CLEAN, np.random.default_rng(1)).astype(float) for p in (pose, moved))
    assert np.abs(smeared - (first + second) / 2).max() < 1.01
    assert np.abs(first - second).max() > 100
