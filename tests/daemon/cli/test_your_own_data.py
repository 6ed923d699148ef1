"""docs/your-own-data.md, run as printed: the CSV that stands there, the commands, and the lines they print."""

import re
import shlex
from pathlib import Path

import pytest

from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import TILTS_RAD, picture

TUTORIAL = Path(__file__).parents[3] / "docs" / "your-own-data.md"


def _blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", TUTORIAL.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def _fits(printed: str, line: str) -> bool:
    """Whether a printed line is the tutorial's, in which `...` stands for anything."""
    return re.fullmatch(".*".join(re.escape(part) for part in line.split("...")), printed) is not None


def test_the_tutorial_runs_as_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("photos").mkdir()
    for number, tilt in enumerate(TILTS_RAD, 1):
        Path(f"photos/photo_{number}.png").write_bytes(picture(tilt))
    (csv,) = _blocks("csv")
    Path("photos/poses.csv").write_text(csv)
    blocks = _blocks("console")
    assert len(blocks) == 3
    for block in blocks:
        command, *expected = block.splitlines()
        ran = handeyed(*shlex.split(command.removeprefix("$ handeyed ")))
        assert ran.status == 0, (command, ran.out, ran.err)
        printed = ran.out.splitlines()
        missing = [line for line in expected if not any(_fits(one, line) for one in printed)]
        assert missing == [], ran.out
