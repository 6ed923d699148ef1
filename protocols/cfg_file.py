"""Text of a controller's configuration file (EIO.cfg, SYS.cfg, MOC.cfg ...) to its instances.

The first line names domain and layout, `EIO:CFG_1.0:6:1::`. Below a line `TYPE:` each instance is a list of
`-Attribute value`; a line that ends with a backslash goes on in the next one; `#` begins a comment.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_TYPE = re.compile(r"[A-Z_0-9]+:")
_ATTRIBUTE = re.compile(r'-([A-Za-z_]\w*)((?:\s+(?:"[^"]*"|-?[\d.][^\s"]*|[^\s"-][^\s"]*))*)')
_NAMES = ("Name", "name", "ModName", "Signal", "File")
_VALUE = re.compile(r'"([^"]*)"|(\S+)')


@dataclass(frozen=True)
class CfgInstance:
    """One instance: its type, its attributes as text ("" for one without a value), and the line where it begins."""

    kind: str
    attributes: dict[str, str]
    line: int

    @property
    def name(self) -> str:
        """Its name, or where it has none the module, signal or file it is about; "" for one without any."""
        return next((self.attributes[key] for key in _NAMES if key in self.attributes), "")


@dataclass(frozen=True)
class CfgFile:
    """Header and instances, in order."""

    header: str
    instances: tuple[CfgInstance, ...]

    @property
    def domain(self) -> str:
        """EIO, SYS, SIO, MOC, PROC or MMC; "" when the first line is no header."""
        return self.header.partition(":")[0] if ":CFG_" in self.header else ""


def parse_cfg(text: str) -> CfgFile:
    """Parse a file; never fails: what it does not know it leaves out."""
    lines = text.replace("\r", "").split("\n")
    return CfgFile(lines[0].strip(), tuple(_instances(lines)))


def _instances(lines: list[str]) -> Iterator[CfgInstance]:
    kind, first, written = "", 0, ""
    for number, raw in enumerate(lines[1:], 2):
        line = raw.strip()
        if not written and _TYPE.fullmatch(line):
            kind = line[:-1]
        elif written or line.startswith("-"):
            first = first or number
            written += line.removesuffix("\\") + " "
            if not line.endswith("\\"):
                yield CfgInstance(kind, dict(_attributes(written)), first)
                first, written = 0, ""


def _attributes(written: str) -> Iterator[tuple[str, str]]:
    for name, values in _ATTRIBUTE.findall(written):
        yield name, " ".join(quoted or bare for quoted, bare in _VALUE.findall(values))
