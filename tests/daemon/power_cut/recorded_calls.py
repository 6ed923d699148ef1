"""Reads what strace recorded of a process' calls on files."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

TRACED = (
    "open,openat,creat,close,lseek,write,pwrite64,writev,pwritev,ftruncate,truncate,fallocate,fsync,fdatasync,"
    "rename,renameat,renameat2,unlink,unlinkat,rmdir,link,linkat,symlink,mkdir,mkdirat,access,faccessat,faccessat2"
)
MAX_BYTES = 1 << 24
"""Longest content of one call that is recorded."""

_CALL = re.compile(r"(\d+) +(\w+)\((.*)\) += (-?\d+|\?)")
_STRING = re.compile(r'"((?:\\x[0-9a-f]{2})*)"(\.\.\.)?')


@dataclass(frozen=True)
class Call:
    """A call that succeeded: its name, its arguments without the strings, the strings, and its result."""

    name: str
    arguments: tuple[str, ...]
    strings: tuple[bytes, ...]
    result: int


def strace(log: Path, *command: str) -> list[str]:
    """The command that records another one in `log`."""
    return ["strace", "-f", "-q", "-xx", "-s", str(MAX_BYTES), "-o", str(log), "-e", f"trace={TRACED}", *command]


def read_calls(log: Path) -> Iterator[Call]:
    """The calls that succeeded, and every `access`, in the order in which they ended."""
    begun: dict[str, str] = {}
    with log.open() as lines:
        for line in lines:
            pid, _, rest = line.rstrip("\n").partition(" ")
            rest = rest.lstrip()
            if rest.endswith("<unfinished ...>"):
                begun[pid] = rest.removesuffix("<unfinished ...>").rstrip()
                continue
            if rest.startswith("<... "):
                rest = begun.pop(pid) + rest.partition("resumed>")[2]
            match = _CALL.match(f"{pid} {rest}")
            if match is None or match[4] == "?" or (match[4].startswith("-") and "access" not in match[2]):
                continue
            found = _STRING.findall(match[3])
            assert not any(cut for _, cut in found), "a call with more content than is recorded"
            strings = tuple(bytes.fromhex(text.replace("\\x", "")) for text, _ in found)
            arguments = tuple(part.strip() for part in _STRING.sub('""', match[3]).split(","))
            yield Call(match[2], arguments, strings, int(match[4]))
