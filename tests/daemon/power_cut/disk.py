"""A disk that keeps what was synchronised, and of all that came later anything: nothing, parts, in any order.

The model is that of ALICE (Pillai et al., "All file systems are not created equal", OSDI 2014) without any promise of a
file system beyond POSIX: fsync of a file keeps its content, fsync of a folder keeps its names. A rename is atomic. A
write may be kept in any of its sectors.
"""

import os
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from tests.daemon.power_cut.recorded_calls import Call

SECTOR = 512

Keep = Callable[[int], list[bool]]
"""Which of so many changes in a row reached the disk."""


@dataclass(frozen=True)
class Write:
    """Bytes written at an offset."""

    offset: int
    content: bytes

    def apply(self, content: bytearray) -> None:
        if len(content) < self.offset:
            content.extend(bytes(self.offset - len(content)))
        content[self.offset : self.offset + len(self.content)] = self.content

    def sectors(self) -> "list[Write]":
        """The parts of this write by sector of the disk."""
        ends = [*range((self.offset // SECTOR + 1) * SECTOR, self.offset + len(self.content), SECTOR)]
        begins, ends = [self.offset, *ends], [*ends, self.offset + len(self.content)]
        return [
            Write(begin, self.content[begin - self.offset : end - self.offset])
            for begin, end in zip(begins, ends, strict=True)
        ]


@dataclass(frozen=True)
class Truncate:
    """A new size."""

    size: int

    def apply(self, content: bytearray) -> None:
        del content[self.size :]
        content.extend(bytes(self.size - len(content)))

    def sectors(self) -> "list[Truncate]":
        return [self]


@dataclass(eq=False)
class File:
    """Content as it was synchronised, and the changes since."""

    durable: bytes = b""
    pending: list[Write | Truncate] = field(default_factory=list)
    size: int = 0

    def change(self, change: Write | Truncate) -> None:
        self.pending.append(change)
        self.size = change.size if isinstance(change, Truncate) else max(self.size, change.offset + len(change.content))

    def sync(self) -> None:
        self.durable, self.pending = self.content([True] * len(self.pending)), []

    def content(self, kept: list[bool], keep_sectors: Keep | None = None) -> bytes:
        """The content when these changes reached the disk; of the others, `keep_sectors` chooses sectors."""
        content = bytearray(self.durable)
        for change, whole in zip(self.pending, kept, strict=True):
            if whole:
                change.apply(content)
            elif keep_sectors is not None:
                parts = change.sectors()
                for part, there in zip(parts, keep_sectors(len(parts)), strict=True):
                    if there:
                        part.apply(content)
        return bytes(content)


@dataclass(eq=False)
class NameChange:
    """Names that are given, or taken away (None), at once. A rename from one folder to another is a change in both."""

    names: "dict[str, Node | None]"
    rename: "Rename | None" = None

    def apply(self, names: "dict[str, Node]") -> None:
        for name, node in self.names.items():
            if node is None:
                names.pop(name, None)
            else:
                names[name] = node


@dataclass(eq=False)
class Rename:
    """A rename between two folders, which is atomic: it reached the disk in both, or in none."""

    durable: bool = False


@dataclass(eq=False)
class Folder:
    """Names as they were synchronised, and the changes since."""

    durable: "dict[str, Node]" = field(default_factory=dict)
    pending: list[NameChange] = field(default_factory=list)
    live: "dict[str, Node]" = field(default_factory=dict)

    def change(self, change: NameChange) -> None:
        self.pending.append(change)
        change.apply(self.live)

    def sync(self) -> None:
        for change in self.pending:
            if change.rename is not None:
                change.rename.durable = True
        self.durable, self.pending = dict(self.live), []

    def names(self, keep: Keep, renamed: dict[Rename, bool]) -> "dict[str, Node]":
        """The names when these changes reached the disk; `renamed` holds what was chosen for other folders."""
        names = dict(self.durable)
        for change, kept in zip(self.pending, keep(len(self.pending)), strict=True):
            rename = change.rename
            if kept if rename is None else renamed.setdefault(rename, kept or rename.durable):
                change.apply(names)
        return names


Node = File | Folder


@dataclass
class _Open:
    node: Node
    path: PurePosixPath
    offset: int = 0
    append: bool = False


class Disk:
    """The files below `root` while recorded calls are replayed."""

    def __init__(self, root: Path) -> None:
        self.root = Folder()
        self._top = PurePosixPath(root)
        self._open: dict[int, _Open] = {}

    def replay(self, call: Call) -> bool:
        """Apply one call; returns whether it changed or synchronised anything below the root."""
        act = getattr(self, f"_{call.name}", None)
        return bool(act is not None and act(call))

    # names

    def _path(self, argument: str, name: bytes) -> PurePosixPath:
        path = PurePosixPath(os.fsdecode(name))
        if path.is_absolute() or argument == "AT_FDCWD":
            return path
        at = self._open.get(int(argument))
        return PurePosixPath("/nowhere") if at is None else at.path / path

    def _parent(self, path: PurePosixPath) -> Folder | None:
        if self._top not in path.parents:
            return None
        node: Node = self.root
        for part in path.relative_to(self._top).parts[:-1]:
            assert isinstance(node, Folder)
            node = node.live[part]
        assert isinstance(node, Folder)
        return node

    def _open_at(self, path: PurePosixPath, flags: str, descriptor: int) -> bool:
        self._open.pop(descriptor, None)
        if path == self._top:
            self._open[descriptor] = _Open(self.root, path)
            return False
        if (parent := self._parent(path)) is None:
            return False
        changed, node = False, parent.live.get(path.name)
        if node is None:
            node = File()
            parent.change(NameChange({path.name: node}))
            changed = True
        if isinstance(node, File) and "O_TRUNC" in flags and node.size:
            node.change(Truncate(0))
            changed = True
        self._open[descriptor] = _Open(node, path, append="O_APPEND" in flags)
        return changed

    def _openat(self, call: Call) -> bool:
        return self._open_at(self._path(call.arguments[0], call.strings[0]), call.arguments[2], call.result)

    def _close(self, call: Call) -> bool:
        self._open.pop(int(call.arguments[0]), None)
        return False

    def _mkdir(self, call: Call) -> bool:
        return self._make(PurePosixPath(os.fsdecode(call.strings[0])))

    def _mkdirat(self, call: Call) -> bool:
        return self._make(self._path(call.arguments[0], call.strings[0]))

    def _make(self, path: PurePosixPath) -> bool:
        if (parent := self._parent(path)) is not None:
            parent.change(NameChange({path.name: Folder()}))
        return parent is not None

    def _unlink(self, call: Call) -> bool:
        return self._remove(PurePosixPath(os.fsdecode(call.strings[0])))

    _rmdir = _unlink

    def _unlinkat(self, call: Call) -> bool:
        return self._remove(self._path(call.arguments[0], call.strings[0]))

    def _remove(self, path: PurePosixPath) -> bool:
        if (parent := self._parent(path)) is not None:
            parent.change(NameChange({path.name: None}))
        return parent is not None

    def _rename(self, call: Call) -> bool:
        old, new = (PurePosixPath(os.fsdecode(name)) for name in call.strings)
        source, target = self._parent(old), self._parent(new)
        if source is None or target is None:
            return False
        node = source.live[old.name]
        if source is target:
            source.change(NameChange({old.name: None, new.name: node}))
        else:
            rename = Rename()
            target.change(NameChange({new.name: node}, rename))
            source.change(NameChange({old.name: None}, rename))
        return True

    # contents

    def _file(self, call: Call) -> _Open | None:
        found = self._open.get(int(call.arguments[0]))
        return found if found is not None and isinstance(found.node, File) else None

    def _write(self, call: Call) -> bool:
        if (at := self._file(call)) is None:
            return False
        assert isinstance(at.node, File)
        offset = at.node.size if at.append else at.offset
        at.node.change(Write(offset, call.strings[0][: call.result]))
        at.offset = offset + call.result
        return True

    def _pwrite64(self, call: Call) -> bool:
        if (at := self._file(call)) is None:
            return False
        assert isinstance(at.node, File)
        at.node.change(Write(int(call.arguments[3]), call.strings[0][: call.result]))
        return True

    def _lseek(self, call: Call) -> bool:
        if (at := self._file(call)) is not None:
            at.offset = call.result
        return False

    def _ftruncate(self, call: Call) -> bool:
        if (at := self._file(call)) is None:
            return False
        assert isinstance(at.node, File)
        at.node.change(Truncate(int(call.arguments[1])))
        return True

    def _fsync(self, call: Call) -> bool:
        found = self._open.get(int(call.arguments[0]))
        if found is None:
            return False
        found.node.sync()
        return True

    _fdatasync = _fsync

    # states after a power cut

    def states(self, random_states: int, chance: random.Random) -> Iterator[dict[str, bytes | None]]:
        """Contents by path (None: a folder) that a power cut now may leave: the extremes, then random ones."""
        for contents in (False, True):
            for names in (False, True):
                yield _contents(self.root, _all(contents), _all(names), None)
        for _ in range(random_states):
            share = chance.choice((0.1, 0.5, 0.9))
            names = _random(chance, share) if chance.random() < 0.5 else _prefix(chance)
            yield _contents(self.root, _random(chance, share), names, _random(chance, chance.random()))


def _all(kept: bool) -> Keep:
    return lambda count: [kept] * count


def _random(chance: random.Random, share: float) -> Keep:
    return lambda count: [chance.random() < share for _ in range(count)]


def _prefix(chance: random.Random) -> Keep:
    def keep(count: int) -> list[bool]:
        first = chance.randint(0, count)
        return [place < first for place in range(count)]

    return keep


def _contents(folder: Folder, contents: Keep, names: Keep, sectors: Keep | None) -> dict[str, bytes | None]:
    found: dict[str, bytes | None] = {}
    renamed: dict[Rename, bool] = {}

    def collect(folder: Folder, path: str) -> None:
        for name, node in folder.names(names, renamed).items():
            if name.endswith("-shm"):  # rebuilt by whoever opens the database first
                continue
            if isinstance(node, File):
                found[path + name] = node.content(contents(len(node.pending)), sectors)
            else:
                found[path + name] = None
                collect(node, f"{path}{name}/")

    collect(folder, "")
    return found


def write_state(state: dict[str, bytes | None], folder: Path) -> None:
    """Write the files of a state into `folder`."""
    folder.mkdir()
    for name, content in state.items():
        if content is None:
            (folder / name).mkdir()
        else:
            (folder / name).write_bytes(content)
