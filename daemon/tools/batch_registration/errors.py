"""Errors of an archive: the whole of it; what is wrong with one scan is an outcome, not an error."""

from daemon.errors import DaemonError


class ArchiveError(DaemonError):
    """The archive cannot be read or written, or there is nobody to do the work."""

    code = "archive-error"
