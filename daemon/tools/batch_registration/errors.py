"""Errors of a whole archive. The failure of one scan is a OutcomeDocument, not an error."""

from daemon.errors import DaemonError


class ArchiveError(DaemonError, code="archive-error"):
    """The archive cannot be read or written, or there is no executor."""
