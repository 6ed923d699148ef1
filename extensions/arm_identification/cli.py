"""`handeyed solve DIR... --arm NAME`: the errors of the arm, from all folders together."""

import typer

from daemon.cli.errors import UnreadableInput
from daemon.cli.output import SolvedFolders, write_document


def solve_arm(of: SolvedFolders) -> bool:
    """Print the arm's errors, and write them as arm.json beside the calibrations. Raises CommandError.

    The box of --at is where the gain of more views is predicted.
    """
    import numpy as np

    from calibration.documents.arm import arm_summary
    from calibration.errors import CalibrationError
    from calibration.kinematics.abb_arms import find_arm
    from daemon.cli.solve import points_file
    from daemon.runtime.clock import Clock
    from daemon.runtime.version import SOFTWARE
    from extensions.arm_identification.mathematics.documents import identify_arm_document
    from extensions.arm_identification.mathematics.session import KnownDistance

    if len(of.solved) < len(of.folders):
        raise UnreadableInput("--arm", "it needs every folder's images", "leave it out")
    box_mm = None if of.at is None else points_file(of.at).box_mm
    within_mm = None if box_mm is None else np.array(box_mm)
    sessions, problems, _ = zip(*of.solved, strict=True)
    names, distances = [session.path.resolve().name for session in sessions], []
    for place, session in enumerate(sessions):
        for row, known in enumerate(session.document.distances):
            if names.count(known.to) != 1 or known.to == names[place]:
                what = f"distances[{row}].to: {known.to!r} is not the name of one other folder of the command"
                raise UnreadableInput(str(session.file), what, "name that folder, too")
            distances.append(KnownDistance(place, names.index(known.to), known.distance_mm, known.sigma_mm))
    try:
        arm, created_at = find_arm(of.value), Clock().timestamp()
        document = identify_arm_document(
            arm, problems, created_at=created_at, software=SOFTWARE, box_mm=within_mm, distances=distances
        )
    except CalibrationError as error:
        raise UnreadableInput("--arm", str(error), "no arm.json is written") from None
    typer.echo(document.model_dump_json() if of.json else arm_summary(document))
    if of.out is not None:
        write_document(of.out / "arm.json", document)
    return True
