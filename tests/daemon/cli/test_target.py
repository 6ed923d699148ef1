"""`handeyed target`: what is printed is the target, true to size."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.documents.target import TargetFile
from calibration.documents.validation import validate_document
from tests.daemon.cli.running import handeyed

DPI = 300
KINDS = {
    "chessboard": ["chessboard"],
    "charuco": ["charuco"],
    "charuco-legacy": ["charuco", "--legacy", "--columns", "6", "--rows", "8"],
    "circles": ["circles"],
    "white-circles": ["circles", "--dots", "white"],
    "asymmetric": ["circles", "--layout", "asymmetric", "--no-large-origin", "--columns", "4", "--pitch-mm", "36"],
    "apriltag-grid": ["apriltag-grid"],
    "aruco-grid": ["aruco-grid", "--first-id", "3"],
    "aruco-marker": ["aruco-marker", "--id", "7"],
}


@pytest.mark.parametrize("arguments", KINDS.values(), ids=KINDS)
def test_the_detector_finds_the_rasterised_print_true_to_size(tmp_path: Path, arguments: list[str]) -> None:
    if shutil.which("pdftoppm") is None:
        pytest.skip("pdftoppm (Debian: poppler-utils) is not here to rasterise the page")
    printed = json.loads(handeyed("target", *arguments, "-o", tmp_path / "target.pdf", "--json").out)
    page = ["pdftoppm", "-r", str(DPI), "-gray", "-singlefile", str(tmp_path / "target.pdf"), str(tmp_path / "page")]
    subprocess.run(page, check=True)
    image = cv2.imread(str(tmp_path / "page.pgm"), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    target = validate_document(TargetFile, {"target": printed["target"]}, "target").target

    found = detect(image, target)

    on_page_mm = (found.corners_px + 0.5) * 25.4 / DPI - printed["target_origin_mm"]
    assert len(found.ids) == len(target.points_mm)
    assert np.abs(on_page_mm - target.points_mm[found.ids, :2]).max() < 0.05


def test_svg_and_pdf_draw_the_same_page(tmp_path: Path) -> None:
    pages = [
        json.loads(handeyed("target", "charuco", "-o", tmp_path / f"a.{kind}", "--json").out) for kind in ("pdf", "svg")
    ]

    assert pages[0]["page_mm"] == pages[1]["page_mm"] == [210.0, 297.0]
    pdf, svg = (tmp_path / "a.pdf").read_bytes(), (tmp_path / "a.svg").read_text()
    boxes = re.findall(rb"^([\d.]+) ([\d.]+) [\d.]+ [\d.]+ re$", pdf, re.MULTILINE)
    corners = re.findall(r"M([\d.]+) ([\d.]+)H", svg)
    assert [(x.decode(), y.decode()) for x, y in boxes] == corners
    assert b"/PrintScaling /None" in pdf
    assert 'width="210mm" height="297mm" viewBox="0 0 210 297"' in svg


def test_the_rulers_ends_are_as_far_apart_as_they_say(tmp_path: Path) -> None:
    handeyed("target", "chessboard", "-o", tmp_path / "a.svg")
    svg = (tmp_path / "a.svg").read_text()

    paths = re.findall(r'<path d="([^"]+)"', svg)[-2:]
    assert svg.count(">100 mm<") == 2
    across = [(float(left), float(right)) for left, right in re.findall(r"M([\d.]+) [\d.]+H([\d.]+)V", paths[0])]
    down = [(float(top), float(bottom)) for top, bottom in re.findall(r"M[\d.]+ ([\d.]+)H[\d.]+V([\d.]+)", paths[1])]
    for ticks in (across, down):
        assert ticks[-1][1] - ticks[0][0] == pytest.approx(100.0, abs=1e-3)


def test_the_cross_reference_table_of_the_pdf_is_right(tmp_path: Path) -> None:
    handeyed("target", "circles", "-o", tmp_path / "a.pdf")
    content = (tmp_path / "a.pdf").read_bytes()

    table = int(content.rsplit(b"startxref\n", 1)[1].split()[0])
    assert content[table:].startswith(b"xref\n0 7\n")
    offsets = re.findall(rb"(\d{10}) 00000 n ", content[table:])
    assert [content[int(offset) :].split(b" ", 1)[0] for offset in offsets] == [b"1", b"2", b"3", b"4", b"5", b"6"]


def test_a_person_gets_the_lines_for_the_settings(tmp_path: Path) -> None:
    ran = handeyed("target", "apriltag-grid", "-o", tmp_path / "a.pdf")

    assert "Print at 100 %" in ran.out
    assert '[target]\nkind = "apriltag-grid"\ncolumns = 5\n' in ran.out
    assert '"target": {"kind":"apriltag-grid"' in ran.out


def test_a_board_that_looks_the_same_turned_is_reported(tmp_path: Path) -> None:
    ambiguous = handeyed("target", "chessboard", "--columns", "8", "-o", tmp_path / "a.pdf")
    clear = handeyed("target", "chessboard", "--columns", "9", "-o", tmp_path / "a.pdf")

    assert "looks the same turned by 180 deg" in ambiguous.out
    assert "looks the same" not in clear.out


def test_the_target_of_a_file_is_printed(tmp_path: Path) -> None:
    (tmp_path / "handeyed.toml").write_text('[target]\nkind = "chessboard"\ncolumns = 5\nrows = 4\npitch_mm = 15\n')

    ran = handeyed("target", "from", tmp_path / "handeyed.toml", "-o", tmp_path / "a.svg", "--page", "letter", "--json")

    assert json.loads(ran.out)["page_mm"] == [279.4, 215.9]


REFUSED = {
    "page too small": (
        ["chessboard", "--pitch-mm", "60"],
        "page: A4 is too small for the target, which needs 720 x 540 mm",
    ),
    "unknown page": (["chessboard", "--page", "A9"], "page: none is called 'A9': one of A4, A3"),
    "absurd page": (["chessboard", "--page", "1x1"], "page: none is called '1x1'"),
    "unknown dictionary": (["charuco", "--dictionary", "DICT_9"], "the dictionary 'DICT_9' is not known: use one"),
    "too many markers": (
        ["charuco", "--columns", "40", "--rows", "40", "--dictionary", "DICT_4X4_50"],
        "DICT_4X4_50 has 50 markers, a target of this size needs 800: check the dictionary, columns and rows",
    ),
    "marker too large": (["charuco", "--marker-mm", "30"], "target: target.charuco: "),
    "unknown family": (
        ["apriltag-grid", "--family", "tag1"],
        "the tag family 'tag1' is not known: use one of tag36h11",
    ),
    "not a number": (["circles", "--pitch-mm", "nan"], "target: target.circles.pitch_mm: nan is not finite: "),
    "unknown layout": (["circles", "--layout", "round"], "target: target.circles.layout: 'round' is not possible: "),
}


@pytest.mark.parametrize(("arguments", "line"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_printed_is_reported(tmp_path: Path, arguments: list[str], line: str) -> None:
    ran = handeyed("target", *arguments, "-o", tmp_path / "a.pdf")

    assert ran.status == 2
    assert line in ran.err
    assert not (tmp_path / "a.pdf").exists()


def test_files_that_name_no_target_or_cannot_be_written_are_reported(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("{}")

    assert "a.json: target: not found" in handeyed("target", "from", tmp_path / "a.json").err
    assert handeyed("target", "from", tmp_path / "b.json").status == 2
    assert "neither .pdf nor .svg" in handeyed("target", "circles", "-o", tmp_path / "a.png").err
    assert "cannot be written" in handeyed("target", "circles", "-o", tmp_path / "no" / "a.pdf").err
