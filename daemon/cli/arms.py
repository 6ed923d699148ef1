"""`handeyed arms`: list the known arms."""

import typer

from daemon.cli.output import Json


def arms(json: Json = False) -> None:
    """List the arms whose reach and joint limits are known: names for \\[robot] model and plan.json."""
    import numpy as np

    from calibration.kinematics.abb_arms import ARMS, evidence_of

    if json:
        from json import dumps

        listed = [
            {
                "name": arm.name,
                "reach_mm": round(arm.reach_mm, 1),
                "lower_deg": np.degrees(arm.lower_rad).round(3).tolist(),
                "upper_deg": np.degrees(arm.upper_rad).round(3).tolist(),
                "evidence": evidence_of(arm.name).state,
                "source": evidence_of(arm.name).source,
            }
            for arm in ARMS.values()
        ]
        typer.echo(dumps(listed))
    else:
        lines = (
            f"{arm.name:<21}reach {arm.reach_mm / 1e3:.2f} m  {evidence_of(arm.name).state}" for arm in ARMS.values()
        )
        typer.echo("\n".join(lines))
