"""Plain numbers: a row of CSV, and a matrix as text. Millimetres, every digit."""

from calibration.documents.exports.subject import Subject
from calibration.transforms import quaternion_from_rotation

COLUMNS = ("parent", "child", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "calibration")


def write_csv(subject: Subject) -> str:
    """A header and one row (RFC 4180), in the shortest digits that restore the numbers; qw >= 0."""
    numbers = [
        *subject.parent_T_child[:3, 3].tolist(),
        *quaternion_from_rotation(subject.parent_T_child[:3, :3]).tolist(),
    ]
    row = [subject.parent, subject.child, *(repr(value + 0.0) for value in numbers), subject.calibration_id]
    return "\r\n".join([",".join(COLUMNS), ",".join(row), ""])


def write_matrix(subject: Subject) -> str:
    """Four rows of four numbers, `parent_T_child` in mm, for numpy.loadtxt, MATLAB's readmatrix and R's read.table."""
    rows = "".join(" ".join(f"{value + 0.0: .15e}" for value in row) + "\n" for row in subject.parent_T_child.tolist())
    return subject.comment("#", f"{subject.parent} <- {subject.child}, mm, rows") + rows
