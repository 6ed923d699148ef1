"""Detectors and solver: half of the package, loaded with the first run and not at the start."""

from importlib import import_module

from daemon.runtime.module_names import module_name

RUN_MODULES = ("calibration.detection.detect", "calibration.documents.identified_arm", "calibration.planning.next_view")


def load_run_modules() -> None:
    """Import what a run needs. Before the arm is armed: an import keeps the interpreter, and the link's heartbeats."""
    for name in RUN_MODULES:
        import_module(module_name(name))
