"""Every refusal names a heading that docs/formats.md has."""

import ast
import re
from collections.abc import Iterator

from tests.structure import ROOT, nodes_of, python_files


def _headings() -> Iterator[str]:
    for file in python_files("calibration/documents", "daemon/sessions/session_import"):
        for node in nodes_of(file):
            match node:
                case ast.Call(func=ast.Name(id="refusal"), args=[_, _, _, _, ast.Constant(value=str(heading))]):
                    yield heading
                case ast.Assign(targets=[ast.Name(id="HEADING")], value=ast.Constant(value=str(heading))):
                    yield heading


def test_the_headings_exist() -> None:
    text = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    anchors = {re.sub(r"[^a-z0-9_ -]", "", title.lower()).replace(" ", "-") for title in titles}
    named = {"robot-poses", *_headings()}
    assert len(named) > 10
    assert named <= anchors
