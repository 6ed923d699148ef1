"""The views of a calibration as a table of plain text, the worst first, as `solve --views` prints it."""

from collections.abc import Sequence

import numpy as np

from calibration.documents.calibration import CalibrationDocument, ViewResultDocument

TEMPERATURE = "camera C"
"""A column only where the temperature is known."""

HEADER = ("picture", "image", "status", "px", "mm", "robot mm", "robot deg", TEMPERATURE, "reason")
LEGEND = (
    "px: RMS of predicted minus found points; mm: RMS in the anchor by the robot's pose as reported;"
    " robot: the estimated error of its pose"
)
RIGHT_ALIGNED = frozenset({"picture", "px", "mm", "robot mm", "robot deg", TEMPERATURE})


def view_table(document: CalibrationDocument) -> str:
    """One line a view: those without an estimate, then the rejected, then the others, each kind the worst first."""
    warm = any(view.camera_temperature_c is not None for view in document.views)
    header = HEADER if warm else tuple(name for name in HEADER if name != TEMPERATURE)
    rows = [header, *(_cells(view, header) for view in worst_first(document.views))]
    widths = [max(len(row[column]) for row in rows) for column in range(len(header))]
    lines = [
        "  ".join(
            cell.rjust(width) if name in RIGHT_ALIGNED else cell.ljust(width)
            for name, cell, width in zip(header, row, widths, strict=True)
        ).rstrip()
        for row in rows
    ]
    return "\n".join([*lines, LEGEND])


def worst_first(views: Sequence[ViewResultDocument]) -> list[ViewResultDocument]:
    """The views by status, then by the larger of their two errors, each over its median of the views in use."""
    used = [view for view in views if view.status != "rejected"]
    scale_px = _median([view.reprojection_px for view in used])
    scale_mm = _median([view.base_error_mm for view in used])

    def badness(view: ViewResultDocument) -> tuple[int, float, int]:
        if view.reprojection_px is None or view.base_error_mm is None:
            return (0 if view.status == "rejected" else 2, 0.0, view.index)
        excess = max(view.reprojection_px / scale_px, view.base_error_mm / scale_mm)
        return 1 if view.status == "rejected" else 2, -excess, view.index

    return sorted(views, key=badness)


def _median(values: Sequence[float | None]) -> float:
    known = [value for value in values if value is not None]
    return max(float(np.median(known)), 1e-12) if known else 1.0


def _cells(view: ViewResultDocument, header: tuple[str, ...]) -> tuple[str, ...]:
    correction = view.robot_correction
    size = (None, None) if correction is None else (correction.translation_mm, correction.rotation_deg)
    temperature_c = view.camera_temperature_c
    cells = (
        str(view.index + 1),
        view.image or "-",
        view.status,
        _number(view.reprojection_px),
        _number(view.base_error_mm),
        *(_number(None if vector is None else float(np.linalg.norm(vector))) for vector in size),
        "-" if temperature_c is None else f"{temperature_c:.1f}",
        view.reason or "",
    )
    return tuple(cell for name, cell in zip(HEADER, cells, strict=True) if name in header)


def _number(value: float | None) -> str:
    """Three significant digits, never with an exponent below a million."""
    if value is None:
        return "-"
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"
