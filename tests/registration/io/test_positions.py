"""Reading and writing at a position, on systems without the calls for it."""

import os
from pathlib import Path

import pytest

from registration.io.durable_file import GuardedFile, new_file


def test_positions_are_read_and_written_where_the_system_has_no_call_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("preadv", "pwrite", "posix_fallocate", "O_DIRECTORY"):  # as on Windows
        monkeypatch.delattr(os, name)
    with new_file(tmp_path / "a.bin") as file:
        file.reserve(6)
        file.write(b"abcdef")
        file.write_at(b"XY", 2)
        file.write(b"gh")
    with GuardedFile.reading(tmp_path / "a.bin", "a.bin") as file:
        buffer = bytearray(3)
        assert file.read_at(memoryview(buffer), 6) == 2
        assert file.read(8) == b"abXYefgh"
        assert buffer == b"gh\0"
