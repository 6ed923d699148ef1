"""Checks the XML section of an E57 file (ASTM E2807) before libE57 reads it.

libE57's parser, Xerces, obeys whatever a document asks for: it reads files and makes requests for a DTD, an external
entity or a schema location, and expands nested entities without a limit. Its recursion ends the process on deep
documents, and its time grows with the square of the number of siblings. So the section must be UTF-8 without any of
these, and bounded.
"""

import re
import struct
from xml.parsers import expat

from registration.errors import CloudFormatError, CloudTruncated, CloudUnsupported
from registration.io.durable_file import GuardedFile

MAGIC = b"ASTM-E57"
HEADER = struct.Struct("<8sIIQQQQ")
"""Signature, major and minor version, file length, offset of the XML in the file, its length without checksums, page
size."""

PAGE_BYTES = 1024
DATA_BYTES = 1020
"""Bytes of a page before its checksum."""

MAX_XML_BYTES = 1 << 24
MAX_DEPTH = 32
MAX_ELEMENTS = 200_000
MAX_CHILDREN = 2_000
"""Elements within one other: libE57 takes half a second for as many."""

DECLARATION = re.compile(
    rb"""\A(\xef\xbb\xbf)?<\?xml\s+version\s*=\s*["']1\.0["'](\s+encoding\s*=\s*["']utf-8["'])?"""
    rb"""(\s+standalone\s*=\s*["'](yes|no)["'])?\s*\?>""",
    re.IGNORECASE,
)
REFUSED = (b"<!DOCTYPE", b"<!ENTITY", b"chemaLocation")
FIX = "do not open it; export the scan again with the scanner's own program"
COPY = "copy the whole file again"


def require_plain_xml(file: GuardedFile, name: str) -> None:
    """Raises CloudError's leaves unless libE57 may read the file's XML section. Moves the file's position."""
    xml = _read_xml(file, name)
    try:
        xml.decode()
    except UnicodeDecodeError:
        raise CloudFormatError(name, "XML", "the XML section is not UTF-8", FIX) from None
    if not DECLARATION.match(xml):
        raise CloudFormatError(name, "XML", "the XML section does not begin as XML 1.0 in UTF-8", FIX)
    for refused in REFUSED:
        if refused in xml:
            what = f"the XML section holds {refused.decode()!r}, which makes a reader open other files"
            raise CloudUnsupported(name, "XML", what, FIX)
    _require_bounded(xml, name)


def _read_xml(file: GuardedFile, name: str) -> bytes:
    """The XML section without the checksums of its pages."""
    file.seek(0)
    head = file.read(HEADER.size)
    if len(head) < HEADER.size:
        raise CloudTruncated(name, "header", f"the file ends after {len(head)} bytes", COPY)
    magic, _, _, _, offset, length, page_bytes = HEADER.unpack(head)
    if magic != MAGIC or page_bytes != PAGE_BYTES:
        raise CloudFormatError(name, "header", "this is no E57 file of 1024-byte pages", "check the file's type")
    if length > MAX_XML_BYTES:
        what = f"the XML section has {length} bytes, the limit is {MAX_XML_BYTES}"
        raise CloudUnsupported(name, "header", what, "export fewer scans into one file")
    page, within = divmod(offset, PAGE_BYTES)
    start = page * PAGE_BYTES
    size = file.seek(0, 2)
    if within >= DATA_BYTES or start >= size:
        raise CloudTruncated(name, "header", f"the XML section should begin at byte {offset}", COPY)
    file.seek(start)
    raw = file.read(min(size - start, (within + length + DATA_BYTES - 1) // DATA_BYTES * PAGE_BYTES))
    data = b"".join(raw[each : each + DATA_BYTES] for each in range(0, len(raw), PAGE_BYTES))
    xml = data[within : within + length]
    if len(xml) < length:
        raise CloudTruncated(name, f"byte {size}", f"{len(xml)} of {length} bytes of the XML section are there", COPY)
    return xml


def _require_bounded(xml: bytes, name: str) -> None:
    """Count elements, their depth and their children while expat parses. Raises CloudFormatError, CloudUnsupported."""
    elements, children = 0, [0]

    def begin(_element: str, _attributes: object) -> None:
        nonlocal elements
        elements += 1
        children[-1] += 1
        children.append(0)
        for count, limit, what in (
            (elements, MAX_ELEMENTS, "elements"),
            (children[-2], MAX_CHILDREN, "elements within one"),
            (len(children) - 1, MAX_DEPTH, "elements within each other"),
        ):
            if count > limit:
                raise CloudUnsupported(name, "XML", f"there are more than {limit} {what}", FIX)

    def end(_element: str) -> None:
        children.pop()

    parser = expat.ParserCreate("UTF-8")
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    try:
        parser.Parse(xml, True)
    except expat.ExpatError as error:
        raise CloudFormatError(name, f"XML line {error.lineno}", expat.ErrorString(error.code), COPY) from None
