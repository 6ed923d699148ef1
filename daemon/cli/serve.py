"""`handeyed serve CONFIG`: run the daemon."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer


def serve(
    config: Annotated[Path, typer.Argument(help="Settings, as in deploy/handeyed.example.toml.")] = Path(
        "handeyed.toml"
    ),
    setup: Annotated[
        bool, typer.Option("--setup", help="First set the cell up in the page; settings that are there are kept.")
    ] = False,
    ready_file: Annotated[
        Path | None, typer.Option(help='A file that is written with {"url", "pid"} once requests are answered.')
    ] = None,
) -> None:
    """Run the daemon until SIGTERM, SIGHUP or Ctrl-C. Nothing moves until a request asks for it."""
    import gc

    gc.disable()  # what is imported stays: looking through it again and again takes a tenth of the start
    from calibration.errors import CalibrationError
    from daemon.cli.rest_client import free_port
    from daemon.composition import serve as serve_settings
    from daemon.config.settings import load_settings_file
    from daemon.errors import DaemonError
    from daemon.runtime.systemd import Systemd
    from daemon.tools.first_setup.settings_before import settings_before
    from drivers.errors import DeviceError

    gc.freeze()
    gc.enable()
    try:
        settings, loaded = (settings_before(config, free_port()), None) if setup else load_settings_file(config)
        setup_file = config.resolve() if setup else None
        if serve_settings(settings, ready_file=ready_file, settings_file=loaded, setup_file=setup_file):
            # The same command, now with the settings that were written.
            os.execv(sys.executable, [sys.executable, *(each for each in sys.orig_argv[1:] if each != "--setup")])  # noqa: S606
    except (CalibrationError, DaemonError, DeviceError) as error:
        # It stays in `systemctl status` of a service that has failed.
        Systemd.from_environment(os.environ, os.getpid()).notify("STATUS=" + " ".join(str(error).split()))
        raise
