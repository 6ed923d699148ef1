"""What an E57 file's XML may not ask of the machine that reads it."""

import socket
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from registration.errors import CloudError
from registration.io.reading import open_cloud
from tests.registration.io.e57_files import e57, with_xml

ROOT = b"<e57Root"
XSI = 'xmlns:i="http://www.w3.org/2001/XMLSchema-instance"'
Edit = Callable[[bytes], bytes]


def before_root(text: str) -> Edit:
    return lambda xml: xml.replace(ROOT, text.encode() + ROOT, 1)


def at_root(attributes: str) -> Edit:
    return lambda xml: xml.replace(ROOT, ROOT + b" " + attributes.encode(), 1)


def at_the_end(text: str) -> Edit:
    return lambda xml: xml.replace(b"</e57Root>", text.encode() + b"</e57Root>")


def encoded(name: str, codec: str) -> Edit:
    def edit(xml: bytes) -> bytes:
        return before_root('<!DOCTYPE e57Root SYSTEM "{url}">')(xml).decode().replace("UTF-8", name).encode(codec)

    return edit


HOSTILE: dict[str, Edit] = {
    "a DTD": before_root('<!DOCTYPE e57Root SYSTEM "{url}">'),
    "an external entity": before_root('<!DOCTYPE e57Root [<!ENTITY x SYSTEM "{url}">]>'),
    "a parameter entity": before_root('<!DOCTYPE e57Root [<!ENTITY % x SYSTEM "{url}"> %x;]>'),
    "nested entities": before_root(
        '<!DOCTYPE e57Root [<!ENTITY a0 "aaaaaaaaaa">'
        + "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 20}">' for n in range(1, 8))
        + "]>"
    ),
    "a schema": at_root(XSI + ' i:noNamespaceSchemaLocation="{url}"'),
    "a schema of the namespace": at_root(
        XSI + ' i:schemaLocation="http://www.astm.org/COMMIT/E57/2010-e57-v1.0 {url}"'
    ),
    "a DTD in UTF-16": encoded("UTF-16", "utf-16"),
    "a DTD in UTF-16 without a mark": encoded("UTF-16", "utf-16-le"),
    "a DTD in UTF-32": encoded("UCS-4", "utf-32"),
    "a DTD in UTF-7": encoded("UTF-7", "utf-7"),
    "a DTD in EBCDIC": encoded("IBM037", "cp037"),
    "UTF-7 in name only": lambda xml: xml.replace(b"UTF-8", b"UTF-7"),
    "no declaration": lambda xml: xml.partition(b"?>")[2].lstrip(),
    "elements within each other": at_the_end('<a type="Structure">' * 6_000 + "</a>" * 6_000),
    "elements beside each other": at_the_end(
        '<a type="Vector">' + '<a type="Structure"/>' * 5_000 + "</a>",
    ),
    "torn XML": lambda xml: xml.replace(b"</e57Root>", b"<"),
    "17 MB": lambda xml: xml,
}


@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", HOSTILE)
def test_libe57_is_not_given_xml_that_asks_for_more(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pye57 = pytest.importorskip("pye57", reason="pye57 is not installed: E57 is not tested")
    opened: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/evil"
        (tmp_path / "b.e57").write_bytes(hostile(tmp_path, name, url))
        monkeypatch.setattr(pye57, "E57", opened.append)
        with pytest.raises(CloudError, match=r"^b\.e57: "), open_cloud(tmp_path / "b.e57"):
            pass
    assert not opened


def hostile(folder: Path, name: str, url: str) -> bytes:
    """A file with the named XML. The limit of size looks at the header, so a large file needs no checksums."""
    if name != "17 MB":
        return with_xml(e57(folder), lambda xml: HOSTILE[name](xml).replace(b"{url}", url.encode()))
    content = bytearray(e57(folder))
    struct.pack_into("<Q", content, 32, 17_000_000)
    return bytes(content) + bytes(18_000_000)


def test_a_file_whose_checksums_hold_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.e57").write_bytes(with_xml(e57(tmp_path), at_the_end("<!-- nothing -->")))
    with open_cloud(tmp_path / "a.e57") as cloud:
        assert sum(len(block) for block in cloud.blocks()) == 10
