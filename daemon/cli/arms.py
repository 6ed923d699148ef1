"""`handeyed arms`: list the known arms."""

import typer

from daemon.cli.output import Json


def arms(json: Json = False) -> None:
    """List the arms whose reach and joint limits are known: names for \\[robot] model and plan.json."""
    import numpy as np

    from calibration.kinematics.abb_arms import ARMS

    if json:
        from json import dumps

        listed = [
            {
                "name": arm.name,
                "reach_mm": round(arm.reach_mm, 1),
                "lower_deg": np.degrees(arm.lower_rad).round(3).tolist(),
                "upper_deg": np.degrees(arm.upper_rad).round(3).tolist(),
            }
            for arm in ARMS.values()
        ]
        typer.echo(dumps(listed))
    else:
        typer.echo("\n".join(f"{arm.name:<21}reach {arm.reach_mm / 1e3:.2f} m" for arm in ARMS.values()))
