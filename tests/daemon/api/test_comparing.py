"""GET /calibrations/{id}/compare?with=..."""

from calibration.documents.pose import PoseDocument
from calibration.transforms import transform
from daemon.model.records import CalibrationRecord
from tests.daemon.calibrations import a_calibration, apply_calibration
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import FLANGE_T_CAMERA


async def with_two(bench: Bench) -> None:
    """ "cal-1" in force, "moved" 5 mm from it, and "open" without a transform."""
    await apply_calibration(bench)
    x = PoseDocument.of(FLANGE_T_CAMERA @ transform([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [3.0, 0.0, 4.0]))
    moved = a_calibration("moved").model_copy(update={"flange_T_camera": x})
    for document in (moved, a_calibration("open", solved=False)):
        record = CalibrationRecord(document.id, None, document.created_at, True, document)
        await bench.application.store.save_calibration(record)


async def test_two_are_compared(bench: Bench) -> None:
    await with_two(bench)
    for path in ("/calibrations/current/compare?with=moved", "/calibrations/cal-1/compare?with=moved"):
        found = (await bench.client.get(path)).json()
        assert (found["a"], found["b"], round(found["translation_mm"], 6)) == ("cal-1", "moved", 5.0)
        assert found["agree"] is None, "the fake's calibrations state no covariance"
    text = await bench.client.get("/calibrations/moved/compare?with=current", headers={"accept": "text/plain"})
    assert text.text.startswith("cal-1 compared with moved: they are 5 mm")


async def test_what_cannot_be_compared_is_refused(bench: Bench) -> None:
    await with_two(bench)
    for query, status, code in (
        ("with=nothing", 404, "not-found"),
        ("with=open", 409, "calibration-unusable"),
        ("", 422, "request-refused"),
        ("with=moved&false_alarm_probability=2", 422, "request-refused"),
    ):
        refused = await bench.client.get(f"/calibrations/current/compare?{query}")
        assert (refused.status_code, refused.json()["code"]) == (status, code), query
