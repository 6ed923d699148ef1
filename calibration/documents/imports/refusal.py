"""Refusals of an import: always a DocumentError with one problem, that names the heading of docs/formats.md."""

from calibration.errors import DocumentError, DocumentProblem

MAX_POSES = 20_000
"""Poses of one file; more are a trajectory, not views of a calibration."""

MAX_TEXT_BYTES = 32_000_000
"""Bytes of a text with poses: 20,000 poses of 16 numbers are below 8 MB."""


def refusal(origin: str, place: str, what: str, fix: str, heading: str = "robot-poses") -> DocumentError:
    """The error to raise; `heading` of docs/formats.md describes what is expected."""
    return DocumentError(origin, [DocumentProblem(place, what, f"{fix} (docs/formats.md#{heading})")])


def decode(content: bytes, origin: str) -> str:
    """Text of UTF-8, UTF-16 with a mark, or Windows' Latin 1; without a byte order mark. Raises DocumentError."""
    if len(content) > MAX_TEXT_BYTES:
        what = f"{len(content) / 1e6:.0f} MB of text, where {MAX_TEXT_BYTES // 1_000_000} MB are read"
        raise refusal(origin, "file", what, "give the poses of the views only")
    if b"\0" in content[:4096] and content[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        raise refusal(origin, "file", "not text", "give the poses as text, .npy or .npz")
    for encoding in ("utf-16",) if content[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "cp1252"):
        try:
            return content.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise refusal(origin, "file", "neither UTF-8 nor UTF-16 text", "save it as UTF-8")
