"""docs/runbook.md and the story of `make test-systemd` have the same commands."""

import ast
import re
from pathlib import Path

from tests.systemd import story

ROOT = Path(__file__).resolve().parents[2]
RUNS = {"shown", "started"}
"""Methods of Story that run a command of the runbook."""


def printed() -> set[str]:
    """The commands of the runbook: the lines of its blocks of shell, without their comments."""
    text = (ROOT / "docs" / "runbook.md").read_text(encoding="utf-8")
    lines = [
        line
        for block in re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
        for line in block.splitlines()
    ]
    return {re.sub(r"\s+#.*", "", line) for line in lines if line.strip()}


def told() -> set[str]:
    """The commands that the story runs as printed."""
    tree = ast.parse(Path(story.__file__).read_text(encoding="utf-8"))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)]
    first = [call.args[0] for call in calls if call.func.attr in RUNS and call.args]  # type: ignore[attr-defined]
    named = {
        name: value
        for name, value in strings(tree).items()
        if any(isinstance(one, ast.Name) and one.id == name for one in first)
    }
    return {ast.literal_eval(one) for one in first if isinstance(one, ast.Constant)} | set(named.values())


def strings(tree: ast.AST) -> dict[str, str]:
    """The names that are given a text."""
    given = [node for node in ast.walk(tree) if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)]
    return {target.id: node.value.value for node in given for target in node.targets if isinstance(target, ast.Name)}


def test_every_command_of_the_runbook_is_run_by_the_story() -> None:
    assert len(printed()) > 30
    assert printed() - told() == set()


def test_the_story_runs_no_command_as_printed_that_the_runbook_does_not_print() -> None:
    assert told() - printed() == set()


def test_every_step_is_run_and_says_what_it_shows() -> None:
    steps = [step.__name__ for step in story.STEPS]
    assert len(set(steps)) == len(steps)
    assert all(step.__doc__ for step in story.STEPS)
