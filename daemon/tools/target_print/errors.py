"""Errors of target_print.

DaemonError
└── PrintRefused          the target cannot be printed on this page
"""

from daemon.errors import DaemonError


class PrintRefused(DaemonError):
    """The target cannot be printed on this page."""

    code = "print-refused"
