"""`handeyed solve` of sessions whose views hold poses or points instead of images, and the examples of the document."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import TRANSFORM_NAMES, CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.session import SessionDocument
from calibration.problem import MeasuredPoints, MeasuredPose, Setup
from tests.daemon.cli.running import handeyed
from tests.simulated.measured_sessions import Measure, MeasuredCell, measured_cell, points, tracker
from tests.simulated.sessions import BOARD

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "sessions.md"
MEASURES = {"poses": tracker(), "poses with covariance": tracker(known=True), "points": points()}


def written(folder: Path, cell: MeasuredCell, change: Callable[[dict[str, Any]], None] = lambda document: None) -> Path:
    views: list[dict[str, Any]] = []
    for view in cell.problem.views:
        row: dict[str, Any] = {"base_T_flange": PoseDocument.of(view.base_T_flange).model_dump(mode="json")}
        match view.measured:
            case MeasuredPoints(ids, points_mm):
                row["points_mm"] = [[int(one), *where.tolist()] for one, where in zip(ids, points_mm, strict=True)]
            case MeasuredPose(camera_T_target, covariance):
                row["camera_T_target"] = PoseDocument.of(camera_T_target).model_dump(mode="json")
                if covariance is not None:
                    row["covariance"] = covariance.tolist()
        views.append(row)
    document = {"schema_version": 1, "setup": cell.problem.setup, "views": views}
    if "points_mm" in views[0]:
        board = {"columns": BOARD.columns, "rows": BOARD.rows, "pitch_mm": BOARD.pitch_mm}
        document["target"] = {"kind": "chessboard", **board}
    change(document)
    folder.mkdir()
    (folder / "session.json").write_text(json.dumps(document))
    return folder


@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
@pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)
def test_a_session_without_images_becomes_an_accepted_calibration(
    measure: Measure, setup: Setup, tmp_path: Path
) -> None:
    cell = measured_cell(np.random.default_rng(2), 12, measure, setup=setup)
    ran = handeyed("solve", written(tmp_path / "a", cell), "--json", "--tolerance", "4")

    assert (ran.status, ran.err) == (0, "")
    document = CalibrationDocument.model_validate_json(ran.out)
    found = getattr(document, TRANSFORM_NAMES[setup][0]).transform()
    assert np.linalg.norm(cell.error(found)[3:]) < 1.5
    assert document.camera is None
    assert document.uncertainty is not None
    assert document.hold_out is not None
    assert document.hold_out.reprojection_px is None


def test_what_is_known_of_the_camera_counts_for_its_poses(tmp_path: Path) -> None:
    folder, expanded_mm = written(tmp_path / "a", measured_cell(np.random.default_rng(2), 5, tracker())), []
    for source in ("this-session", "file", "nominal"):
        ran = handeyed("solve", folder, "--json", "--known", f"camera={source}")
        document = CalibrationDocument.model_validate_json(ran.out)
        assert document.uncertainty is not None
        expanded_mm.append(max(point.expanded_mm for point in document.uncertainty.points))
    assert expanded_mm == sorted(set(expanded_mm))


def test_a_person_can_read_it(tmp_path: Path) -> None:
    ran = handeyed("solve", written(tmp_path / "a", measured_cell(np.random.default_rng(2), 12, points())), "--views")

    assert "accepted" in ran.out.splitlines()[0]
    assert "in the base (each picture left out in turn)" in ran.out
    assert "measured points scatter by" in ran.out


def drop(name: str, index: int) -> Callable[[dict[str, Any]], None]:
    return lambda document: document["views"][index].pop(name)


def put(name: str, value: Any, index: int) -> Callable[[dict[str, Any]], None]:
    return lambda document: document["views"][index].update({name: value})


SPOILED = {
    "two observations": (tracker(), put("image", "a.png", 3), "views[3]", "a view has one of 'image', 'corners_px'"),
    "none": (tracker(), drop("camera_T_target", 2), "views[2]", "a view has one of"),
    "covariance of nothing": (points(), put("covariance", np.eye(6).tolist(), 1), "views[1]", "'camera_T_target'"),
    "covariance of five": (tracker(), put("covariance", np.eye(5).tolist(), 1), "views[1]", "six rows of six"),
    "negative": (tracker(), put("covariance", (-np.eye(6)).tolist(), 1), "views[1]", "positive variances"),
    "one covariance less": (tracker(known=True), drop("covariance", 4), "views[4].covariance", "where other pictures"),
    "no target": (points(), lambda document: document.pop("target"), "target", "missing: add it"),
    "unknown point": (points(), put("points_mm", [[88, 0, 0, 500]], 1), "views[1].points_mm[0]", "no point 88"),
    "a mixture": (
        points(),
        lambda document: document["views"].__setitem__(
            0,
            {
                "base_T_flange": document["views"][0]["base_T_flange"],
                "camera_T_target": document["views"][0]["base_T_flange"],
            },
        ),
        "views",
        "they hold camera_T_target and points_mm",
    ),
}


@pytest.mark.parametrize(("measure", "change", "place", "what"), SPOILED.values(), ids=SPOILED)
def test_a_wrong_session_is_refused_with_its_place(
    measure: Measure, change: Callable[[dict[str, Any]], None], place: str, what: str, tmp_path: Path
) -> None:
    cell = measured_cell(np.random.default_rng(2), 6, measure)
    ran = handeyed("solve", written(tmp_path / "a", cell, change))

    assert ran.status == 2
    assert place in ran.err
    assert what in ran.err


@pytest.mark.parametrize("option", [["--method", "tsai"], ["--pictures", "out"]])
def test_options_for_images_are_refused(option: list[str], tmp_path: Path) -> None:
    ran = handeyed("solve", written(tmp_path / "a", measured_cell(np.random.default_rng(2), 6, tracker())), *option)

    assert ran.status == 2
    assert f"{option[0]}: it is for images only" in ran.err


def test_the_examples_of_the_document_are_sessions() -> None:
    examples = re.findall(r"```json\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    held = [SessionDocument.model_validate_json(example).views[0].observation for example in examples]
    assert held == ["camera_T_target", "points_mm", "cloud", "image"]
