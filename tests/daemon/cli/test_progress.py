"""Long work shows a bar, on a terminal only."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.daemon.cli.sessions import with_images
from tests.support.terminal import on_terminal

pytestmark = pytest.mark.slow

COMMAND = [sys.executable, "-m", "daemon.cli", "solve", "--json"]


def test_a_terminal_sees_how_many_images_are_done(tmp_path: Path) -> None:
    folder = with_images(tmp_path / "cell")
    seen = on_terminal([*COMMAND, str(folder)])
    count = len(list(folder.glob("*.png")))
    assert seen.status == 0
    assert f"{count}/{count}" in seen.shown
    assert seen.out.startswith(b'{"schema_version":2')


def test_a_file_sees_nothing_of_it(tmp_path: Path) -> None:
    done = subprocess.run([*COMMAND, with_images(tmp_path / "cell")], capture_output=True, check=False)

    assert (done.returncode, done.stderr) == (0, b"")
