"""`handeyed solve`: a session folder in, an exit status and a calibration out."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.transforms import difference
from daemon.cli.solve import format_ranges
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import FLANGE_T_CAMERA, with_corners, with_images


def test_pictures_and_poses_become_an_accepted_calibration(tmp_path: Path) -> None:
    ran = handeyed("solve", with_images(tmp_path / "cell"), "--json")

    assert (ran.status, ran.err) == (0, "")
    document = CalibrationDocument.model_validate_json(ran.out)
    assert document.flange_T_camera is not None
    translation_mm, rotation_rad = difference(document.flange_T_camera.transform(), FLANGE_T_CAMERA)
    assert translation_mm < 0.5
    assert rotation_rad < 1e-3


def test_several_folders_are_one_json_line_each(tmp_path: Path) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a"), with_corners(tmp_path / "b"), "--json")

    lines = ran.out.splitlines()
    assert ran.status == 0
    assert [CalibrationDocument.model_validate_json(line).verdict.accepted for line in lines] == [True, True]


def test_without_json_a_person_can_read_it(tmp_path: Path) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a"))

    assert ran.out.splitlines()[0] == f"{tmp_path / 'a'}  accepted"
    for word in ("flange_T_camera", "uncertainty", "hold-out", "noise found", "pictures", "weakest"):
        assert word in ran.out


@pytest.mark.parametrize(("tolerance_mm", "status"), [("3", 0), ("0.001", 3)])
def test_the_tolerance_decides(tmp_path: Path, tolerance_mm: str, status: int) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a"), "--json", "--tolerance", tolerance_mm)
    limits = CalibrationDocument.model_validate_json(ran.out).verdict.limits
    assert limits is not None
    assert (ran.status, limits.tolerance_mm) == (status, float(tolerance_mm))


def test_the_uncertainty_counts_at_the_points_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "part.json"
    point = {"name": "far away", "position_mm": [0, 0, 1e5], "frame": "camera"}
    file.write_text(json.dumps({"schema_version": 1, "points": [point]}))
    ran = handeyed("solve", with_corners(tmp_path / "a"), "--at", file)
    assert ran.status == 3
    assert "far away" in ran.out


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--tolerance", "0"), "--tolerance: 0.0 mm is no tolerance: give U in mm"),
        (("--at", "nowhere.json"), "no such file"),
        (("--at", "wrong.json"), "no minimum above its maximum"),
    ],
)
def test_a_wrong_requirement_is_refused(tmp_path: Path, options: tuple[str, str], says: str) -> None:
    (tmp_path / "wrong.json").write_text('{"schema_version": 1, "box_mm": [[0, 0, 1], [1, 1, 0]]}')
    name, value = options
    ran = handeyed("solve", with_corners(tmp_path / "a"), name, tmp_path / value if value.endswith("json") else value)
    assert ran.status == 2
    assert says in ran.err


def test_the_result_is_written_where_asked(tmp_path: Path) -> None:
    one, other = with_corners(tmp_path / "a"), with_corners(tmp_path / "b")

    assert handeyed("solve", one, "--out", tmp_path / "one.json").status == 0
    assert handeyed("solve", one, other, "--out", tmp_path / "results").status == 0

    for file in ("one.json", "results/a/calibration.json", "results/b/calibration.json"):
        CalibrationDocument.model_validate_json((tmp_path / file).read_bytes())


def test_an_unwritable_result_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    ran = handeyed("solve", with_corners(tmp_path / "a"), "--out", tmp_path / "file" / "x.json")

    assert ran.status == 1
    assert "cannot be written" in ran.err


@pytest.mark.parametrize("method", ["three-pose", "park", "daniilidis"])
def test_closed_forms_are_chosen_by_name(tmp_path: Path, method: str) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a"), "--method", method, "--json")

    assert CalibrationDocument.model_validate_json(ran.out).method == method


def test_an_unknown_method_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a"), "--method", "magic")

    assert ran.status == 2
    assert ran.err.startswith("--method: none is called 'magic': one of auto, three-pose")


def test_motions_that_cannot_determine_x_give_no_transform_and_status_3(tmp_path: Path) -> None:
    def stand_still(document: dict) -> None:  # type: ignore[type-arg]
        for view in document["views"][1:]:
            view.update(document["views"][0])

    ran = handeyed("solve", with_corners(tmp_path / "a", stand_still), "--json")

    document = CalibrationDocument.model_validate_json(ran.out)
    assert ran.status == 3
    assert document.flange_T_camera is None
    assert any(finding.severity == "error" and finding.fix for finding in document.verdict.findings)


def test_an_unreadable_folder_does_not_keep_the_others_from_being_solved(tmp_path: Path) -> None:
    ran = handeyed("solve", tmp_path / "nowhere", with_corners(tmp_path / "a"), "--json")

    assert ran.status == 2
    assert json.loads(ran.out)["verdict"]["accepted"] is True
    assert ran.errors == [f"{tmp_path / 'nowhere'}: folder: not there: check the path"]


def test_numbers_in_a_row_are_joined() -> None:
    assert format_ranges([0, 1, 2, 5, 7, 8]) == "0-2, 5, 7-8"
    assert format_ranges([3]) == "3"


@pytest.mark.data
@pytest.mark.slow
def test_real_sessions_are_solved(real_data: Path) -> None:
    ran = handeyed("solve", real_data / "ic_charuco", real_data / "ic_circles", "--json")

    charuco, circles = (CalibrationDocument.model_validate_json(line) for line in ran.out.splitlines())
    assert charuco.base_T_camera is not None and circles.flange_T_camera is not None
    assert charuco.hold_out is not None and charuco.hold_out.base_error_mm <= 1.7


@pytest.mark.data
@pytest.mark.slow
def test_251_rendered_views_of_a_small_board_come_to_the_truth(real_data: Path) -> None:
    ran = handeyed("solve", real_data / "metric_1", "--json")

    truth = PoseDocument.model_validate(
        json.loads((real_data / "metric_1" / "truth.json").read_text())["base_T_camera"]
    )
    document = CalibrationDocument.model_validate_json(ran.out)
    assert document.base_T_camera is not None
    translation_mm, rotation_rad = difference(document.base_T_camera.transform(), truth.transform())
    assert document.accuracy.expanded_mm is not None
    assert translation_mm < document.accuracy.expanded_mm
    assert rotation_rad < np.radians(0.10)
    assert ran.errors[0].startswith(f"{real_data / 'metric_1' / 'session.json'}: views[")


def test_poses_that_turn_too_little_hear_what_better_ones_would_have_given(tmp_path: Path) -> None:
    small = handeyed("solve", with_corners(tmp_path / "small", share_of_turns=0.4))

    assert "5 planned poses would leave U = 0.1" in small.out
    assert "these 6 leave 0." in small.out


def test_what_is_known_is_stated_in_the_words_of_the_settings(tmp_path: Path) -> None:
    """In place of the session's, section by section; what is known better leaves less."""

    def measured(document: dict[str, Any]) -> None:
        document["known"] = {"target": {"source": "measured", "length_mm": 200.0, "instrument": "ruler-class-2"}}

    folder = with_corners(tmp_path / "a", measured)
    whole = ("target.source=certified", "camera=this-session", "arm=absolute-accuracy")
    by_calliper = ("target.source=measured", "target.length_mm=200", "target.instrument=calliper")
    found = [expanded_mm(folder), expanded_mm(folder, *by_calliper), expanded_mm(folder, *whole)]
    assert sorted(found, reverse=True) == found
    assert found[-1] < 0.9 * found[0]
    assert expanded_mm(folder, "target.source=printed") > found[0], "length_mm of the session does not remain"


def expanded_mm(folder: Path, *known: str) -> float:
    ran = handeyed("solve", folder, "--json", *(word for pair in known for word in ("--known", pair)))
    assert ran.err == ""
    return float(json.loads(ran.out)["accuracy"]["expanded_mm"])


@pytest.mark.parametrize(
    ("known", "says"),
    [("camera=good", "this-session"), ("camera", "no KEY=VALUE"), ("lens=maker", "lens"),
     ("target.source=measured", "needs length_mm"), ("target.length_mm=short", "length_mm")],
)  # fmt: skip
def test_what_cannot_be_known_is_refused(tmp_path: Path, known: str, says: str) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a"), "--known", known)
    assert (ran.status, ran.out) == (2, "")
    assert "--known" in ran.err and says in ran.err
