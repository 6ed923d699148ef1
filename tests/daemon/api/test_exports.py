"""GET /calibrations/{id}/exports, the list and every file."""

import numpy as np

from calibration.documents.exports.formats import FORMATS, POSE_FORMATS
from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument, SessionDocument, ViewDocument
from calibration.transforms import difference
from daemon.model.records import CalibrationRecord
from daemon.sessions.session_files import SESSION_FILE
from tests.calibration.documents.exports.readers import READERS
from tests.daemon.calibrations import a_calibration, apply_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import BASE_T_TARGET, CAMERA, FLANGE_T_CAMERA


async def test_every_format_of_the_one_in_force_is_listed_and_answered(bench: Bench) -> None:
    await apply_calibration(bench)
    listed = (await bench.client.get("/calibrations/current/exports")).json()["exports"]
    assert [each["format"] for each in listed] == [*FORMATS, *POSE_FORMATS]
    for each in listed[: len(FORMATS)]:
        answer = await bench.client.get(each["href"])
        assert answer.status_code == 200, each
        assert answer.headers["content-type"].split(";")[0] == each["media_type"]
        assert f'filename="{each["file"]}"' in answer.headers["content-disposition"]
        apart_mm, _ = difference(READERS[each["format"]](answer.content), FLANGE_T_CAMERA)
        assert apart_mm < 2e-4


async def test_frames_and_decimals_are_chosen(bench: Bench) -> None:
    await apply_calibration(bench)
    query = {"parent": "flange", "child": "left/camera_link", "decimals": 2}
    text = (await bench.client.get("/calibrations/cal-1/exports/ros-tf", params=query)).text
    assert "frame_id: flange" in text
    assert "child_frame_id: left/camera_link" in text
    assert "x ahead" in text


async def test_the_poses_of_the_run_are_answered(bench: Bench) -> None:
    store = bench.application.store
    document = a_calibration("with-run")
    await store.save_calibration(CalibrationRecord("with-run", "run-1", document.created_at, True, document))
    view = ViewDocument(base_T_flange=PoseDocument.of(BASE_T_TARGET), image="view_000.png")
    session = SessionDocument(
        schema_version=1, setup="eye-in-hand", camera=CameraDocument.of(CAMERA), views=[view],
    )  # fmt: skip
    folder = store.run_folder("run-1")
    folder.mkdir(parents=True)
    (folder / SESSION_FILE).write_text(session.model_dump_json())
    answer = await bench.client.get("/calibrations/with-run/exports/poses-toml")
    assert answer.status_code == 200, answer.text
    position = ", ".join(repr(round(value, 4)) for value in np.array(BASE_T_TARGET[:3, 3]).tolist())
    assert f"translation_mm = [{position}]" in answer.text


async def test_what_cannot_be_exported_is_refused(bench: Bench) -> None:
    await apply_calibration(bench)
    open_one = a_calibration("open", solved=False)
    await bench.application.store.save_calibration(CalibrationRecord("open", None, "2026-11-22", False, open_one))
    for path, status, code in (
        ("nothing/exports", 404, "not-found"),
        ("open/exports/csv", 409, "calibration-unusable"),
        ("cal-1/exports/halkon", 404, "not-found"),
        ("cal-1/exports/csv?child=a%0Ab", 422, "request-refused"),
        ("cal-1/exports/csv?decimals=99", 422, "request-refused"),
        ("cal-1/exports/csv?decimls=2", 422, "request-refused"),
        ("cal-1/exports/poses-toml", 404, "not-found"),
    ):
        refused = await bench.client.get(f"/calibrations/{path}")
        assert (refused.status_code, refused.json()["code"]) == (status, code), path
