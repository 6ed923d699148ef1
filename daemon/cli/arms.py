"""`handeyed arms`: list the known arms, or describe one of one's own."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.output import Json, print_answer

if TYPE_CHECKING:
    from calibration.kinematics.arm import Arm


def arms(
    description: Annotated[
        Path | None, typer.Option("--from", metavar="FILE", help="URDF or Denavit-Hartenberg table (CSV) of an arm.")
    ] = None,
    tip: Annotated[str | None, typer.Option(metavar="LINK", help="The flange's link; by default tool0.")] = None,
    name: Annotated[str | None, typer.Option(metavar="NAME", help="Its name; by default the file's.")] = None,
    json: Json = False,
) -> None:
    """List the arms whose reach and joint limits are known: names for \\[robot] model and plan.json.

    With --from print the line of an arm of one's own, to be written in place of a name.

    Exit status: 0 printed, 2 the file describes no such arm as those listed.
    """
    if description is not None:
        _describe(description, tip, name or description.stem, json=json)
        return
    from calibration.kinematics.abb_arms import ARMS
    from calibration.kinematics.arm_evidence import evidence_of

    listed = [
        {**_facts(arm), "evidence": evidence_of(arm.name).state, "source": evidence_of(arm.name).source}
        for arm in ARMS.values()
    ]
    lines = (f"{arm['name']:<21}reach {arm['reach_mm'] / 1e3:.2f} m  {arm['evidence']}" for arm in listed)
    print_answer(json, listed, "\n".join(lines))


def _describe(file: Path, tip: str | None, name: str, *, json: bool) -> None:
    from calibration.documents.arm_description import read_arm_description
    from calibration.kinematics.arm_row import write_arm_row
    from daemon.runtime.bounded_read import read_document

    arm = read_arm_description(read_document(file), file.name, name=name.replace("|", " "), tip=tip)
    print_answer(json, {**_facts(arm), "row": write_arm_row(arm)}, write_arm_row(arm))
    if not json:
        how = "write this line as [robot] model, or give it wherever an arm is named"
        typer.echo(f"reach {arm.reach_mm / 1e3:.2f} m; {how}", err=True)


def _facts(arm: "Arm") -> dict[str, Any]:
    import numpy as np

    return {
        "name": arm.name,
        "reach_mm": round(arm.reach_mm, 1),
        "lower_deg": np.degrees(arm.lower_rad).round(3).tolist(),
        "upper_deg": np.degrees(arm.upper_rad).round(3).tolist(),
    }
