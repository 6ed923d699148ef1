"""Where a command writes its cloud: a file appears whole or not at all, and nothing else is ever replaced."""

import os
from pathlib import Path

import pytest

from registration.errors import CloudIOError
from registration.io.durable_file import new_file


def write(path: Path) -> None:
    with new_file(path) as file:
        file.write(b"cloud")


def test_a_file_is_written_and_an_earlier_one_replaced(tmp_path: Path) -> None:
    path = tmp_path / "out.ply"
    path.write_bytes(b"earlier")
    write(path)
    assert path.read_bytes() == b"cloud"
    assert [file.name for file in tmp_path.iterdir()] == ["out.ply"]


def test_a_pipe_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    """As root a rename would replace /dev/null, for every program of the machine."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(CloudIOError, match="not a file"):
        write(path)
    assert path.is_fifo()
    assert [file.name for file in tmp_path.iterdir()] == ["pipe"]


def test_a_folder_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    (tmp_path / "out.ply").mkdir()
    with pytest.raises(CloudIOError, match="not a file"):
        write(tmp_path / "out.ply")


def test_a_link_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    """Where standard output is a file, /dev/stdout is a link to it."""
    (tmp_path / "stdout.txt").write_bytes(b"lines")
    (tmp_path / "out.ply").symlink_to("stdout.txt")
    with pytest.raises(CloudIOError, match="a link, not a file"):
        write(tmp_path / "out.ply")
    assert (tmp_path / "stdout.txt").read_bytes() == b"lines"
