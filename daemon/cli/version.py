"""`handeyed version`."""

import platform
from importlib import metadata

import typer

from daemon.cli.output import Json

NUMERICS = ("numpy", "scipy", "opencv-python-headless")
"""The libraries whose version can change a figure."""


def version(json: Json = False) -> None:
    """Print the version, and those of the libraries that figures depend on."""
    versions = {name: metadata.version(name) for name in ("handeyed", *NUMERICS)}
    versions["python"] = platform.python_version()
    if json:
        from json import dumps

        typer.echo(dumps(versions))
    else:
        typer.echo("\n".join(f"{name} {number}" for name, number in versions.items()))
