"""`handeyed solve SCAN_DIR --artefact ...`: calibrate from clouds instead of pictures."""

from pathlib import Path
from typing import TYPE_CHECKING

from daemon.cli.errors import UnreadableInput
from daemon.cli.output import new_calibration

if TYPE_CHECKING:
    from calibration.documents.calibration import CalibrationDocument
    from calibration.problem import Setup
    from calibration.solution import NamedPoint
    from calibration.transforms import Array
    from calibration.verdict import VerdictLimits

ARTEFACTS = ("sphere", "none")


def check_options(artefact: str | None, radius_mm: float | None, rough: Path | None, method: str) -> None:
    """Check that the options are consistent. Raises CommandError."""
    refusals = [
        (artefact is not None and artefact not in ARTEFACTS, "--artefact", f"none is called {artefact!r}",
         f"one of {', '.join(ARTEFACTS)}"),
        (artefact == "sphere" and radius_mm is None, "--radius-mm", "the sphere's radius is not given",
         "measure it, or take it from its certificate: --radius-mm 48.37"),
        (radius_mm is not None and not 0 < radius_mm < 1e5, "--radius-mm", f"{radius_mm} mm is no radius",
         "give the sphere's radius in mm"),
        (radius_mm is not None and artefact != "sphere", "--radius-mm", "only a sphere has a radius",
         "add --artefact sphere, or leave it out"),
        (rough is not None and artefact != "none", "--rough", "only --artefact none begins with a rough X",
         "add --artefact none, or leave it out"),
        (artefact is not None and method != "auto", "--method", "it is for images only", "leave it out"),
    ]  # fmt: skip
    for refused, place, what, fix in refusals:
        if refused:
            raise UnreadableInput(place, what, fix)


def solve_scan(
    folder: Path, radius_mm: float | None, rough: Path | None, required: "tuple[VerdictLimits, tuple[NamedPoint, ...]]"
) -> "CalibrationDocument":
    """Calibrate from a sphere when its radius is given, else from overlapping surfaces, with a rough X or none.

    `required`: the limits of the verdict, and the points where the uncertainty counts.
    Raises DocumentError, RegistrationError.
    """
    import numpy as np

    from calibration.likelihood.mapped_points import with_points
    from registration.calibrate.outcome import judge_scan
    from registration.calibrate.sphere import solve_sphere_scan
    from registration.calibrate.surfaces import solve_surface_scan
    from registration.scan import setup_of
    from registration.scan_folder import read_scan

    views, (limits, points) = read_scan(folder), required
    if radius_mm is not None:
        solution = solve_sphere_scan(views, radius_mm)
    else:
        solution = solve_surface_scan(views, None if rough is None else _rough_x(rough, setup_of(views)))
    solution = with_points(solution, points, np.array([view.anchor_T_mount for view in views]))
    return new_calibration(solution, judge_scan(solution, limits))


def _rough_x(file: Path, setup: "Setup") -> "Array":
    """X of a calibration of the same set-up. Raises DocumentError, ScanError."""
    from daemon.cli.compare import read_calibration
    from registration.errors import ScanError
    from registration.scan import scanner_mount_of

    document = read_calibration(file)
    if setup == "eye-in-hand":
        return scanner_mount_of(document).flange_T_camera
    if document.base_T_camera is None:
        raise ScanError(f"calibration {document.id} has no base_T_camera", "use an eye-to-hand calibration")
    return document.base_T_camera.transform()
