"""Errors of a whole archive. The failure of one scan is a OutcomeDocument, not an error."""

from daemon.errors import DaemonError


class ArchiveError(DaemonError):
    """The archive cannot be read or written, or there is no executor."""

    code = "archive-error"
