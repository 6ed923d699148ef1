"""Detectors and solver: half of the package, loaded with the first run and not at the start."""

from importlib import import_module

from daemon.runtime.module_names import module_name

RUN_MODULES = ("calibration.detection.detect", "calibration.solve", "calibration.planning.next_view")

LOADED_ON_FIRST_USE = ("scipy.linalg", "scipy.optimize", "scipy.special")
"""Parts of SciPy that `import scipy` leaves to the first call."""


def load_run_modules() -> None:
    """Import what a run needs. Before the arm is armed: an import keeps the interpreter, and the link's heartbeats."""
    for name in (*map(module_name, RUN_MODULES), *LOADED_ON_FIRST_USE):
        import_module(name)
