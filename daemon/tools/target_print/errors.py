"""Errors of printing targets.

DaemonError
└── PrintRefused          this target cannot be put on this page
"""

from daemon.errors import DaemonError


class PrintRefused(DaemonError):
    """This target cannot be put on this page."""

    code = "print-refused"
