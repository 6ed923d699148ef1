"""One number for a picture: whoever reads of it, in words, tables, charts or captions, reads its index + 1."""

import asyncio
import json
import re
from pathlib import Path
from typing import Any

import pytest

from calibration.documents.calibration import CalibrationDocument, ViewResultDocument
from calibration.documents.view_table import view_table
from calibration.sentences.sentence import Sentence, sentences_in, text_of
from calibration.solution import ViewResult
from daemon.api.schemas.runs import RunDocument
from daemon.model.records import Planning, RunRecord
from daemon.model.run_states import RunState
from daemon.reports.context import Picture, ReportContext
from daemon.reports.reports import calibration_report
from daemon.runs.supervisor import progress_of
from daemon.tools.session_pictures.write import residual_page
from tests.daemon.calibrations import document_with_covariance

INDEX, NUMBER = 3, 4
OTHERS = {"off_mm": 61.0, "off_deg": 87.0, "shift_px": 0.5, "shift_mm": 0.5, "sigma_px": 0.5, "depth_mm": 50.0}
SAID = (
    Sentence("views-not-used", views=[INDEX], why=Sentence("pose-not-finite")),
    Sentence("image-repeated", view=INDEX),
    Sentence("pose-mistyped", view=INDEX, **OTHERS),
    Sentence("poses-swapped", first=INDEX, second=INDEX),
    Sentence("board-moved", view=Sentence("view-or", view=INDEX, others=[INDEX])),
    Sentence("track-not-declared", groups=[Sentence("group-of-views", views=[INDEX])], at_mm=[], x=0.5, y=0.5, z=0.5),
    Sentence("stands-at-view", number=NUMBER, **OTHERS),
)
RUNS = {"taught": None, "planned": Planning(pictures=INDEX), "by hand": Planning(pictures=INDEX)}
"""A planned run looks once before its first station; by hand a picture was refused: each stored one more."""


def run_at(how: str, *, taken: int) -> RunRecord:
    """The run when that many pictures are stored."""
    planning = None if RUNS[how] is None else Planning(pictures=taken)
    station, request = taken - (planning is not None), {"manual": True} if how == "by hand" else {}
    return RunRecord("r", "calibration", RunState.CAPTURING, station, 9, "", "", request=request, planning=planning)


def document() -> CalibrationDocument:
    view = ViewResultDocument(
        index=INDEX, image="a.png", status="rejected", reason="pose-disagrees", reprojection_px=0.5, base_error_mm=0.5,
        robot_correction=None,
    )  # fmt: skip
    return document_with_covariance().model_copy(update={"views": [view]})


def in_python() -> dict[str, str]:
    """What is said and shown of the picture, by the place."""
    drawn = Picture("data:image/png;base64,iVBORw0KGgo=", 4, 3, "picture.rejected", {"view": INDEX})
    report = calibration_report(document(), ReportContext(pictures=(drawn,)))
    figure = ("a.jpg", ViewResult(INDEX, None, "rejected", None, None, None, None), "")
    page = residual_page("", type("Solved", (), {"views": (), "findings": ()})(), (8, 8), [figure], 1.0)
    return {
        "table": view_table(document()).splitlines()[1],
        "report, row": re.search(r"<tr><td>(\d+)</td><td>a.png", report)[1],  # type: ignore[index]
        "report, chart": re.search(r">(\d+)</text></svg>", report)[1],  # type: ignore[index]
        "report, caption": re.search(r"Picture \d+, the", report)[0],  # type: ignore[index]
        "report, reason": re.search(r"picture \d+: ", report)[0],  # type: ignore[index]
        "residuals": re.search(r"<figcaption>([^<]*)", page)[1],  # type: ignore[index]
        **{f"progress, {how}": str(progress_of(run_at(how, taken=NUMBER))).partition(" of")[0] for how in RUNS},
        **{
            f"sentence {one.id}, {tag}": text_of(one.id, one.params, sentences_in(tag))
            for one in SAID
            for tag in ("en", "de", "es", "zh")
        },
    }


async def on_the_page(node: str, how: str) -> dict[str, str]:
    run: Any = RunDocument.of(run_at(how, taken=INDEX))
    given = {
        "index": INDEX,
        "run": {**vars(run), "planning": run.planning and {}},
        "said": [one.pair() for one in SAID],
    }
    script, pipe = Path(__file__).with_name("numbers_of_a_picture.mjs"), asyncio.subprocess.PIPE
    started = await asyncio.create_subprocess_exec(node, str(script), json.dumps(given), stdout=pipe)
    shown: dict[str, str] = json.loads((await started.communicate())[0])
    return shown


def first_number(text: str) -> int:
    return int(re.search(r"\d+", text)[0])  # type: ignore[index]


def test_python_says_one_number() -> None:
    assert {place: first_number(text) for place, text in in_python().items()} == dict.fromkeys(in_python(), NUMBER)


@pytest.mark.parametrize("how", RUNS)
async def test_the_page_shows_the_same(node: str, how: str) -> None:
    shown = await on_the_page(node, how)
    assert {"film", "table", "progress"} < shown.keys()
    assert {place: first_number(text) for place, text in shown.items()} == dict.fromkeys(shown, NUMBER)


def test_data_keeps_the_index() -> None:
    assert document().model_dump(mode="json")["views"][0]["index"] == INDEX
    assert SAID[0].pair()["params"]["views"] == [INDEX]
