"""What Prometheus and Grafana are given: promtool is content, and every rule and panel asks for something there is."""

import asyncio
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from daemon.runtime.metrics import Metric, exposition, process_families
from tests.daemon.cell_under_test import serving, settings_for
from tests.support.waiting import LIMIT_S

DEPLOY = Path(__file__).resolve().parents[3] / "deploy"
NAME = re.compile(r"\b(handeyed_\w+|process_\w+|up)\b(?=[{\[ ])")

NEVER_UNSEEN = {"up", "handeyed_store_sound", "handeyed_arm_stop_unconfirmed", "handeyed_runs_ended_total"}
"""What each dashboard shows."""

needs_promtool = pytest.mark.skipif(
    shutil.which("promtool") is None, reason="promtool is not here: apt-get install prometheus"
)


async def page_of_a_cell_that_has_worked(folder: Path) -> str:
    async with serving(
        settings_for(folder, plc={"port": 0}, calibration={"policy": "auto", "tolerance_mm": 20.0})
    ) as bench:
        await bench.client.post("/calibrate", params={"wait": 200})
        await bench.client.post("/nowhere")
        page = (await bench.client.get("/metrics")).text
    assert "handeyed_calibration_expanded_meters" in page
    return page


def promtool(*arguments: str, text: str = "", cwd: Path | None = None) -> str:
    command = ["promtool", *arguments]
    done = subprocess.run(command, check=False, input=text, text=True, capture_output=True, cwd=cwd, timeout=LIMIT_S)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@needs_promtool
async def test_promtool_finds_nothing_wrong(tmp_path: Path) -> None:
    page = await page_of_a_cell_that_has_worked(tmp_path)
    said = await asyncio.to_thread(promtool, "check", "metrics", text=page)
    assert said == ""


@needs_promtool
@pytest.mark.parametrize(
    "arguments",
    [("check", "config", "prometheus.yml"), ("check", "config", "--syntax-only", "fleet.yml"),
     ("check", "rules", "handeyed.rules.yml"),
     ("test", "rules", "handeyed.rules.test.yml"), ("test", "rules", "handeyed.updates.test.yml")],
    ids=" ".join,
)  # fmt: skip
def test_promtool_accepts_what_is_deployed(arguments: tuple[str, ...]) -> None:
    assert "FAILED" not in promtool(*arguments, cwd=DEPLOY / "prometheus")


async def test_rules_and_panels_ask_for_what_there_is(tmp_path: Path) -> None:
    page = await page_of_a_cell_that_has_worked(tmp_path)
    there = {"up", *re.findall(r"^# TYPE (\w+)", page, re.MULTILINE)}
    rules = (DEPLOY / "prometheus" / "handeyed.rules.yml").read_text(encoding="utf-8")
    assert set(NAME.findall(rules)) <= there
    for name in ("handeyed", "fleet"):
        dashboard = json.loads((DEPLOY / "grafana" / f"{name}.json").read_text(encoding="utf-8"))
        asked = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
        assert set(NAME.findall("\n".join(asked))) <= there
        assert len({panel["id"] for panel in dashboard["panels"]}) == len(dashboard["panels"])
        assert set(NAME.findall("\n".join(asked))) >= NEVER_UNSEEN


def test_the_cells_of_a_plant_have_the_labels_that_rules_and_dashboards_choose_by() -> None:
    folder = DEPLOY / "prometheus"
    jobs = yaml.safe_load((folder / "fleet.yml").read_text(encoding="utf-8"))["scrape_configs"]
    files = [file for job in jobs for sd in job["file_sd_configs"] for file in sd["files"]]
    groups = [group for file in files for group in yaml.safe_load((folder / file).read_text(encoding="utf-8"))]
    assert [(group["labels"]["job"], group["labels"]["cell"]) for group in groups] == [("handeyed", "press-1")]


@needs_promtool
@pytest.mark.parametrize("dashboard", ["handeyed", "fleet"])
def test_the_panels_ask_what_prometheus_understands(dashboard: str, tmp_path: Path) -> None:
    """promtool parses what stands in a rule."""
    panels = json.loads((DEPLOY / "grafana" / f"{dashboard}.json").read_text(encoding="utf-8"))["panels"]
    asked = [target["expr"].replace("$cell", "c") for panel in panels for target in panel["targets"]]
    rules = [{"record": f"panel:{number}", "expr": expr} for number, expr in enumerate(asked)]
    file = tmp_path / "rules.yml"
    file.write_text(json.dumps({"groups": [{"name": "panels", "rules": rules}]}))
    assert f"{len(rules)} rules found" in promtool("check", "rules", str(file))


def test_a_counter_keeps_every_digit() -> None:
    lines = list(Metric("n_total", "counter", "a", {(): 1_234_567_890.0}).lines())
    assert lines[-1] == "n_total 1234567890"
    assert list(Metric("g", "gauge", "a", {(): 0.1}).lines())[-1] == "g 0.1"


def test_labels_are_escaped() -> None:
    text = exposition([Metric("m", "gauge", "about", {(("path", 'a"b\\c\nd'),): 1.0})])
    assert text.splitlines()[-1] == r'm{path="a\"b\\c\nd"} 1'


def test_memory_and_descriptors_are_this_process() -> None:
    memory, descriptors = process_families()
    assert memory.samples[()] > 1e7
    assert 3 <= descriptors.samples[()] < 10_000


def test_without_proc_there_are_none(tmp_path: Path) -> None:
    assert process_families(tmp_path) == []
