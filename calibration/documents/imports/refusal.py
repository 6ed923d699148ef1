"""Refusals of an import: always a DocumentError with one problem, that names the heading of docs/formats.md."""

import lzma
import re
import zipfile
import zlib
from tokenize import TokenError

from calibration.errors import DocumentError, DocumentProblem

DAMAGED = (
    ValueError, EOFError, OSError, OverflowError, SyntaxError, LookupError, TypeError, AttributeError, MemoryError,
    RecursionError, TokenError,
)  # fmt: skip
"""What numpy raises for a damaged file; its header is a Python literal."""
DAMAGED_ARCHIVE = (*DAMAGED, zipfile.BadZipFile, zlib.error, lzma.LZMAError, RuntimeError)
"""What zipfile and numpy raise for a damaged .npz file."""

MAX_POSES = 20_000  # poses of one file; more are a trajectory, not views of a calibration
MAX_TEXT_BYTES = 32_000_000  # bytes of a text with poses: 20,000 poses of 16 numbers are below 8 MB
MAX_UNPACKED_BYTES = 256_000_000  # of pictures and numbers that one file holds
ZIP = b"PK\x03\x04"  # how the sheets of spreadsheet programs begin
PLAIN = {0x1A: None, ord("\u2212"): "-", **dict.fromkeys(map(ord, "\u00a0\u202f\u2009\u3000"), " ")} | {
    wide: wide - 0xFEE0 for wide in range(0xFF01, 0xFF5F)
}
"""Ctrl-Z, which some programs of Windows write last; Unicode's minus; wide blanks and such that do not break; the
full-width digits, letters and signs of East Asian keyboards."""

CHINESE = re.compile(rb"(?:[\x00-\x7f]|[\xa1-\xf7][\xa1-\xfe])*")  # in pairs, which Latin accents are not


def refusal(origin: str, place: str, what: str, fix: str, heading: str = "robot-poses") -> DocumentError:
    """The error to raise; `heading` of docs/formats.md describes what is expected."""
    return DocumentError(origin, [DocumentProblem(place, what, f"{fix} (docs/formats.md#{heading})")])


def plain(text: str) -> str:
    """The text with usual digits, signs and blanks for those that only look like them."""
    return text.translate(PLAIN)


def decode(content: bytes, origin: str) -> str:
    """Text of UTF-8, UTF-16, GBK or Windows' Latin 1, without a byte order mark and what looks like a sign or a blank.
    Raises DocumentError."""
    if len(content) > MAX_TEXT_BYTES:
        what = f"{len(content) / 1e6:.0f} MB of text, where {MAX_TEXT_BYTES // 1_000_000} MB are read"
        raise refusal(origin, "file", what, "give the poses of the pictures only")
    if content[:4] == ZIP:
        raise refusal(origin, "file", "a sheet or an archive, not text", "save the sheet as CSV")
    if b"\0" in content[:4096] and content[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        for encoding, zeros, others in (("utf-16-le", content[1:4096:2], content[:4096:2]),
                                        ("utf-16-be", content[:4096:2], content[1:4096:2])):  # fmt: skip
            if len(content) % 2 == 0 and not any(zeros) and 0 not in others:
                return plain(content.decode(encoding))  # without a mark, every other byte is 0
        raise refusal(origin, "file", "not text", "give the poses as text, .npy or .npz")
    one_byte = "gbk" if CHINESE.fullmatch(content) else "cp1252"
    for encoding in ("utf-16",) if content[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", one_byte):
        try:
            return plain(content.decode(encoding))
        except UnicodeDecodeError:
            continue
    raise refusal(origin, "file", "neither UTF-8 nor UTF-16 text", "save it as UTF-8")
