"""Hand-eye calibration as a library: arrays in, results out.

    import handeyed

    session = handeyed.Session.open("folder")            # or of_corners, of_poses, of_points from your own arrays
    result = handeyed.solve(session, tolerance_mm=0.5)
    X = result.flange_T_camera.transform()               # (4, 4), mm
    points_base = handeyed.register(points, result, base_T_flange)

Lengths are in mm, `a_T_b` maps coordinates of b to coordinates of a, quaternions have w first. Everything named here is
stable (semantic versioning); the rooms beneath are not. `Client` asks a running daemon (handeyed/client.py).
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handeyed.client import Client
    from handeyed.errors import ClientError
    from handeyed.library import Session, assess, export, plan, read_cloud, register, solve

__all__ = ["Client", "ClientError", "Session", "assess", "export", "plan", "read_cloud", "register", "solve"]


def __getattr__(name: str) -> Any:
    """Import the library with the first name that is asked for: the command starts without it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = {"Client": "client", "ClientError": "errors"}.get(name, "library")
    return getattr(importlib.import_module(f"handeyed.{module}"), name)


def __dir__() -> list[str]:
    return list(__all__)
