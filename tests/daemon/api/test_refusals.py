"""What a refusal says: words where they are asked for, when to come again, and what to do about each value."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.errors import CalibrationError
from calibration.kinematics.joint_path import OutsideBox
from calibration.sentences.sentence import Sentence, sentences_in, text_of
from daemon.api.problems import PASSING, RETRY_AFTER_S, STATUS, handle, problem_of
from daemon.api.routes.help_codes import _entries, _leaves
from daemon.cell.motion_rules import box_words
from daemon.errors import (
    AbortHeld,
    AppliedMeanwhile,
    ArmUnknown,
    CellBusy,
    CellNotReady,
    CursorUnknown,
    DaemonError,
    NoCalibration,
    NotFound,
    PathRefused,
    RunInProgress,
    Stopping,
    StopUnconfirmed,
    ToleranceLoosened,
)
from drivers.errors import DeviceError, MoveRefused
from registration.errors import RegistrationError
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import Gate

TEXT = {"accept": "text/plain"}


@pytest.mark.parametrize(
    ("method", "path", "body", "begins"),
    [
        ("GET", "/runs/nowhere", None, "404 not-found: "),
        ("GET", "/nowhere", None, "404 no-such-page: "),
        ("POST", "/calibrate", {"count": 1}, "422 document-refused: "),
        ("POST", "/verify", {}, "409 no-calibration: "),
        ("GET", "/runs?limit=0", None, "422 request-refused: "),
        ("POST", "/calibrate?count=3", "not JSON", "4"),
    ],
)
async def test_errors_are_words_where_words_are_asked_for(
    bench: Bench, method: str, path: str, body: Any, begins: str
) -> None:
    answer = await bench.client.request(method, path, json=body, headers=TEXT)
    assert answer.headers["content-type"] == "text/plain; charset=utf-8"
    assert answer.text.startswith(begins), answer.text
    assert "\ndo:   " in answer.text
    assert answer.text.endswith("\n")
    json = await bench.client.request(method, path, json=body)
    assert json.headers["content-type"] == "application/problem+json"
    assert f"{json.json()['status']} {json.json()['code']}: " in answer.text


def test_a_refusal_is_said_in_any_language_from_what_it_is_made_of() -> None:
    problem = problem_of(ToleranceLoosened(0.75, 0.5))
    assert problem.details is not None
    made = problem.details["what"]
    assert text_of(made.id, made.params) == problem.detail
    assert text_of(made.id, made.params, sentences_in("de")) == (
        "eine Toleranz von 0,75 mm ist größer als die 0,5 mm der Einstellungen"
    )
    assert problem_of(NotFound("no such key", "see GET /keys")).details is None, "no table holds these"


@pytest.mark.parametrize(("error", "said"), [
    (RunInProgress("verify", "r1"), "der Lauf r1 (Kurzprüfung) ist im Gang"),
    (CellBusy(Sentence("holder-run", run="r1")), "die Zelle ist belegt: Lauf r1"),
    (CellNotReady((Sentence("motors-off"), Sentence("not-automatic"))),
     "die Motoren sind aus; nicht im Automatikbetrieb"),
    (AbortHeld(()), "eine SPS hat „Abbruch“ gesetzt"),
    (ArmUnknown(upright=False), "die Fehler eines Arms werden für einen stehenden bestimmt, und"
      " [robot] base_frame ist geneigt"),
    (ArmUnknown("CRB 15000"), "die Fehler eines Arms werden für sechs Achsen bestimmt, und CRB 15000 hat sieben"),
    (AppliedMeanwhile(0), "noch keine Kalibrierung ist aktiv"),
    (CursorUnknown("runs", "r9"), "in der Liste runs gibt es „r9“ nicht"),
    (NoCalibration("wrist"), "keine Kalibrierung von wrist ist aktiv"),
    (StopUnconfirmed("r1", Sentence("stop-unconfirmed-standing", why="?"), stopped=False, disarmed=True),
     "Lauf r1 ist beendet, aber: nicht bestätigt, dass der Arm steht: ?"),
    (Stopping(), "der Dienst wird beendet"),
    (PathRefused(3, OutsideBox(0.5, np.array([1.0, 2.5, 3.0]), 4.0, carried=False), box_words((0, 0, 0), (1, 1, 1))),
     "Pose 3: nach 50 % des Weges wäre der Flansch bei (1,0; 2,5; 3,0) mm, 4,0 mm außerhalb des Arbeitsraums"
     " von (0, 0, 0) bis (1, 1, 1)"),
    (NotFound.noun("scan", "s1"), "es gibt keinen Scan „s1“"),
], ids=lambda one: type(one).__name__ if isinstance(one, Exception) else "")  # fmt: skip
def test_what_an_operator_meets_is_said_whole_in_german(error: DaemonError, said: str) -> None:
    details = problem_of(error).details
    assert details is not None
    assert text_of(details["what"].id, details["what"].params, sentences_in("de")) == said
    assert "as-written" not in {details["what"].id, details["fix"].id}


async def test_what_passes_by_itself_says_when_to_come_again(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with serving(settings_for(tmp_path), parts) as bench:
        run = (await bench.client.post("/calibrate")).json()
        await gate.reached.wait()
        busy = await bench.client.post("/calibrate")
        assert (busy.status_code, busy.json()["code"]) == (409, "run-in-progress")
        assert int(busy.headers["retry-after"]) > 0
        assert busy.json()["details"] == {
            "what": {
                "id": "run-is-in-progress",
                "params": {"kind": {"id": "kind-calibration", "params": {}}, "run": run["id"]},
            },
            "fix": {"id": "wait-or-abort-run", "params": {"run": run["id"]}},
        }
        await bench.client.post(run["links"]["abort"])
        gate.open.set()
        bench.robot.status["motors_on"] = False
        off = await bench.client.post("/calibrate")
        assert (off.status_code, int(off.headers["retry-after"]) > 0) == (503, True)
        never = await bench.client.post("/verify")
        assert (never.json()["code"], "retry-after" in never.headers) == ("no-calibration", False)


@pytest.mark.parametrize(("status", "passes"), [("BUSY", True), ("UNREACHABLE", False)])
async def test_a_move_that_another_one_is_in_the_way_of_says_when_to_come_again(status: str, passes: bool) -> None:
    answer = await handle(None, MoveRefused("robot", "a move is running", "wait for it", status))  # type: ignore[arg-type]
    assert answer.status_code == 409
    assert ("retry-after" in answer.headers) is passes


MENDED_BY_SOMEBODY = {
    "run-over": "it stays over",
    "not-held": "it is let go, and held again",
    "not-waiting": "the run never waits for anybody",
    "same-pose": "the arm is moved on",
    "too-few-views": "more views are taken",
    "no-calibration": "one is made",
    "calibration-unusable": "another one is made",
    "no-scanner": "the settings name one",
    "scan-empty": "a view is added",
    "no-poses": "poses are given",
    "arm-unknown": "the settings name the arm",
    "not-installed": "the request leaves it out",
    "key-exists": "another name is given",
    "sweep-needed": "the scanner is swept",
    "move-refused": "the reason stands at the controller, but for BUSY",
    "not-comparable": "other documents are compared",
    "export-refused": "another format is asked for",
    "setup-conflict": "the file is read anew, or the daemon is started with --setup",
}
"""Codes of a 409 that waiting does not mend, and what does."""

OF_EXTENSIONS = {"no-profiler", "sweep-too-long"}


def test_each_conflict_says_when_to_come_again_or_is_mended_by_somebody() -> None:
    conflicts = {entry.code for entry in _entries().values() if entry.status == 409}
    assert conflicts >= PASSING
    assert conflicts - PASSING - OF_EXTENSIONS == set(MENDED_BY_SOMEBODY)
    assert 503 in RETRY_AFTER_S


def test_each_class_with_a_status_of_its_own_is_below_the_roots_that_help_walks() -> None:
    roots = (DaemonError, DeviceError, RegistrationError, CalibrationError)
    assert set(STATUS) - {kind for root in roots for kind in _leaves(root)} == set()


@pytest.mark.parametrize(
    ("path", "body", "place", "fix"),
    [
        ("/calibrate", {"count": 2}, "count", "give 3 or more"),
        ("/calibrate", {"count": "many"}, "count", "give a whole number"),
        ("/robot/jog", {"axis": 6, "by_deg": 31}, "by_deg", "give 30 or less"),
        ("/scans", {"name": "x" * 201}, "name", "give at most 200 characters"),
        ("/calibrate", {"manual": "yes"}, "manual", "give true or false"),
        ("/calibrate", {"poses": 3}, "poses", "give a list"),
        ("/calibrations/current/solve", {"method": "best"}, "method", "give 'auto', 'three-pose'"),
        ("/calibrate?wait=-1", {}, "query.wait", "give 0 or more"),
        ("/calibrate?wait=soon", {}, "query.wait", "change what the message names"),
    ],
)
async def test_a_value_that_is_refused_says_what_to_give(
    bench: Bench, path: str, body: dict[str, Any], place: str, fix: str
) -> None:
    problem = (await bench.client.post(path, json=body)).json()
    assert fix in problem["fix"], problem
    assert any(each["place"] == place for each in problem.get("problems", [{"place": place}])), problem
