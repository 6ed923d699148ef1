"""Long work shows a bar, on a terminal only."""

import os
import pty
import subprocess
import sys
from pathlib import Path

from tests.cli.sessions import with_images

COMMAND = [sys.executable, "-m", "daemon.cli", "solve", "--json"]


def read_all(terminal: int) -> str:
    """What was written to a terminal whose other end is closed."""
    shown = b""
    while True:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # Linux says so when the last writer has gone
            return shown.decode()
        if not piece:
            return shown.decode()
        shown += piece


def test_a_terminal_sees_how_many_images_are_done(tmp_path: Path) -> None:
    folder = with_images(tmp_path / "cell")
    master, slave = pty.openpty()
    with subprocess.Popen([*COMMAND, folder], stdout=subprocess.PIPE, stderr=slave) as solving:
        os.close(slave)
        shown = read_all(master)
        out, _ = solving.communicate()
    os.close(master)

    count = len(list(folder.glob("*.png")))
    assert solving.returncode == 0
    assert f"{count}/{count}" in shown
    assert out.startswith(b'{"schema_version":1')


def test_a_file_sees_nothing_of_it(tmp_path: Path) -> None:
    done = subprocess.run([*COMMAND, with_images(tmp_path / "cell")], capture_output=True, check=False)

    assert (done.returncode, done.stderr) == (0, b"")
