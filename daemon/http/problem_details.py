"""What a status is called: as in RFC 9110, whichever Python this is. Some names changed with it, and in Python 3.13."""

from http import HTTPStatus

_RENAMED = {
    413: "Content Too Large",
    414: "URI Too Long",
    416: "Range Not Satisfiable",
    422: "Unprocessable Content",
}


def phrase_of(status: int) -> str:
    """Not Found"""
    return _RENAMED.get(status) or HTTPStatus(status).phrase
