"""Real photographs with poses that went wrong on the way in: the cause is named first, and nothing is accepted."""

import json
from pathlib import Path

import pytest

from calibration.detection import detect as detection
from calibration.problem import Problem
from calibration.solve import solve_hand_eye
from calibration.verdict import judge
from daemon.sessions.session_reader import load_problem, open_session
from tests.support.cases import crossed
from tests.support.computed_once import ComputedOnce

pytestmark = [pytest.mark.data, pytest.mark.slow]

CODES = {
    "ZYX_as_XYZ": "euler-order",
    "ZYX_rev": "euler-order",
    "ZYZ_as_ZYX": "euler-order",
    "extr_intr": "euler-order",
    "euler_as_rotvec": "euler-read-as-vector",
    "rotvec_as_euler": "vector-read-as-euler",
}
SESSIONS = {
    **{f"rc_{cell}_{what}": CODES[what] for what, cell in crossed(CODES, ("ic_charuco", "ic_circles"))},
    "rotvecAsEuler": "vector-read-as-euler",
    "lexi": "poses-in-lexical-order",
    "shift8": "poses-shifted",
    "stale": "poses-off-by-one",
    "eih": "setup-swapped",
}


def odd_session(real_data: Path, folder: Path, name: str) -> Problem:
    """The session with the pictures of the real one beside it."""
    text = (real_data / "odd_sessions" / f"{name}.json").read_text()
    pictures = real_data / ("ic_circles" if "ic_circles" in name else "ic_charuco")
    for view in json.loads(text)["views"]:
        picture = folder / view["image"]
        picture.parent.mkdir(parents=True, exist_ok=True)
        if not picture.exists():
            picture.write_bytes((pictures / view["image"]).read_bytes())
    (folder / "session.json").write_text(text)
    return load_problem(open_session(folder))


def test_the_cause_is_named_and_no_other_and_nothing_is_accepted(
    real_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(detection, "detect", ComputedOnce(detection.detect))  # the pictures of all are those of two
    known = {*SESSIONS.values(), "poses-in-micrometres", "degrees-read-as-radians", "poses-inverted", "pose-mistyped"}
    named = {}
    for name in SESSIONS:
        problem = odd_session(real_data, tmp_path / name, name)
        solution = solve_hand_eye(problem)
        named[name] = [finding.code for finding in solution.findings if finding.code in known]
        assert not judge(problem, solution).accepted, name
    assert named == {name: [code] for name, code in SESSIONS.items()}
