"""`handeyed arms --from`: the line it prints is an arm wherever one is named; docs/formats.md's table is an example."""

import json
import re
from pathlib import Path

from calibration.kinematics.abb_arms import find_arm
from daemon.config.settings import RobotSettings
from tests.daemon.cli.running import handeyed

PAGE = (Path(__file__).parents[3] / "docs" / "formats.md").read_text(encoding="utf-8")
BOX = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


def test_the_table_of_the_documents_is_the_arm_they_name(tmp_path: Path) -> None:
    found = re.search(r"```csv\n(a_mm,alpha_deg.*?)```", PAGE, re.DOTALL)
    assert found is not None
    (tmp_path / "arm.csv").write_text(found[1])
    ran = handeyed("arms", "--from", tmp_path / "arm.csv")
    line = ran.out.strip()
    assert (ran.status, line.rpartition(" | ")[0] in PAGE) == (0, True)
    settings = RobotSettings(address="tcp://10.0.0.1:4242", model=line, box_mm=BOX)
    assert (settings.model, settings.model_name) == (line, "arm")
    assert find_arm(line).reach_mm == find_arm("IRB 1600-6/1.45").reach_mm
    described = json.loads(handeyed("arms", "--from", tmp_path / "arm.csv", "--name", "a|b", "--json").out)
    assert (described["name"], described["reach_mm"]) == ("a b", 1450.0)


def test_what_is_no_arm_ends_with_2(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text("<robot/>")
    for file, words in (("arm.urdf", "0 joints"), ("none.urdf", "no such file")):
        ran = handeyed("arms", "--from", tmp_path / file)
        assert (ran.status, words in ran.err) == (2, True)
