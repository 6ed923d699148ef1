"""`handeyed devices`: list the cameras that answer discovery."""

from daemon.cli.output import Json, print_answer


def devices(json: Json = False) -> None:
    """List cameras that answer: address for \\[camera], vendor, model, serial number, and what they can.

    Looks for Basler, GenTL, GigE Vision, USB3 Vision and video devices. Free cameras are opened for a moment.
    """
    from daemon.tools.camera_discovery import discover

    found = discover()
    print_answer(json, [vars(entry) for entry in found], "\n".join(entry.line() for entry in found))
