"""A target in one word: chessboard:9x6:23.6, charuco:5x7:36.195:18.256:DICT_6X6_250, circles-asymmetric:7x11:20:white.

Columns x rows and lengths in mm, as in session.json.
"""

from typing import Any

from calibration.documents.imports.refusal import refusal
from calibration.documents.target import TargetFile, described
from calibration.documents.validation import validate_document
from calibration.targets import PrintedTarget, Target

FORMS: dict[str, tuple[str, ...]] = {
    "chessboard": ("size", "pitch_mm"),
    "charuco": ("size", "square_mm", "marker_mm", "dictionary", "legacy"),
    "circles-symmetric": ("size", "pitch_mm", "dots", "origin"),
    "circles-asymmetric": ("size", "pitch_mm", "dots", "origin"),
    "apriltag-grid": ("size", "tag_mm", "gap_mm", "family"),
    "aruco-grid": ("size", "marker_mm", "gap_mm", "dictionary", "first_id"),
    "aruco-marker": ("marker_mm", "dictionary", "id"),
}
"""What stands between the colons after each kind."""

OPTIONAL = frozenset(("legacy", "dots", "origin", "family", "first_id"))
HEADING = "targets"


def target_of_text(text: str) -> PrintedTarget:
    """The target of a text. Raises DocumentError."""
    kind, *parts = text.split(":")
    if kind not in FORMS:
        raise refusal("--target", kind or "target", "no such kind", f"one of {', '.join(FORMS)}, or a file", HEADING)
    names = FORMS[kind]
    needed = len([name for name in names if name not in OPTIONAL])
    if not needed <= len(parts) <= len(names):
        raise refusal("--target", text, f"{len(parts)} values after {kind}", f"write {example(kind)}", HEADING)
    data: dict[str, Any] = {"kind": kind.split("-")[0] if kind.startswith("circles") else kind}
    if kind.startswith("circles"):
        data["layout"] = kind.removeprefix("circles-")
    for name, part in zip(names, parts, strict=False):
        if name == "size":
            columns, _, rows = part.lower().partition("x")
            data |= {"columns": columns, "rows": rows}
        elif name == "legacy":
            data[name] = part == "legacy"
        else:
            data[name] = part
    return target_of_data(data, f"--target {text}")


def text_of_target(target: Target) -> str:
    """The text from which `target_of_text` reads this target."""
    values = {name: str(value) for name, value in described(target).items() if value is not False}
    kind = "-".join(filter(None, (values.pop("kind"), values.pop("layout", ""))))
    values |= {"size": f"{values.get('columns')}x{values.get('rows')}"} | (
        {"legacy": "legacy"} if "legacy" in values else {}
    )
    return ":".join([kind, *(values[name] for name in FORMS[kind] if name in values)])


def target_of_data(data: dict[str, Any], origin: str) -> PrintedTarget:
    """The target of a mapping as in session.json. Raises DocumentError."""
    return validate_document(TargetFile, {"target": data}, origin).target


def example(kind: str) -> str:
    """The form of a kind, such as chessboard:COLUMNSxROWS:pitch_mm."""
    return ":".join([kind, *("COLUMNSxROWS" if name == "size" else name for name in FORMS[kind])])
