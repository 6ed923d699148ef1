"""The runner of the benchmarks replaces sections one by one and names what fails or hangs."""

import importlib
from pathlib import Path

import pytest

from benchmarks import __main__ as runner


def test_a_section_is_replaced_and_the_others_stay(tmp_path: Path) -> None:
    file = tmp_path / "benchmarks.md"
    for name, text in (("one", "1"), ("two", "2"), ("one", "3")):
        runner.put(file, name, runner.section(name, ("--few",), text, ""))
    written = file.read_text(encoding="utf-8")
    assert written.startswith("# Benchmarks")
    assert [line for line in written.splitlines() if line.startswith("## ")] == ["## one", "## two"]
    assert "```\n3\n```" in written
    assert "```\n2\n```" in written
    assert "```\n1\n```" not in written
    assert "`python -m benchmarks.one --few`" in written


def test_words_and_the_tables_of_longer_runs_stay_around_a_new_table(tmp_path: Path) -> None:
    file = tmp_path / "benchmarks.md"
    old = "## one\n\n`old command` (then)\n\nFailed: it did.\n\nHow to read it.\n\n```\n1\n```\n"
    old += "\nLonger:\n\n```\n2\n```\n"
    file.write_text(f"# Benchmarks\n\n{old}\n## two\n", encoding="utf-8")
    for _ in range(2):
        runner.put(file, "one", runner.section("one", ("--few",), "3", ""))
    written = file.read_text(encoding="utf-8")
    order = ("--few", "How to read it.", "```\n3\n```\n", "Longer:", "```\n2\n```\n", "## two")
    assert [written.count(word) for word in order] == [1] * len(order)
    assert sorted(order, key=written.index) == list(order)
    assert "Failed" not in written
    assert "```\n1\n```" not in written


def test_a_benchmark_that_fails_says_so_in_its_section() -> None:
    assert "Failed: exit status 2." in runner.section("one", (), "", "exit status 2")


@pytest.mark.parametrize("tier", [runner.QUICK, runner.FULL])
def test_the_tiers_name_benchmarks_that_exist(tier: dict[str, tuple[str, ...]]) -> None:
    assert set(tier) | runner.BY_NAME_ONLY <= set(runner.available())


def test_wrong_arguments_are_a_named_failure() -> None:
    text, trouble = runner.run("hand_eye.kinhec", ("--no-such-option",), 60.0)
    assert (text, trouble) == ("", "exit status 2")


def test_one_that_takes_too_long_is_stopped() -> None:
    _, trouble = runner.run("hand_eye", (), 0.01)
    assert trouble == "stopped after 0 s"


def test_the_tiers_name_benchmarks_that_are_there() -> None:
    assert {*runner.QUICK, *runner.FULL, *runner.BY_NAME_ONLY} <= set(runner.available())
    assert runner.STARTED_BY_OTHERS.isdisjoint(runner.available())


@pytest.mark.parametrize("name", runner.available())
def test_each_benchmark_is_imported(name: str) -> None:
    module = importlib.import_module(f"benchmarks.{name}")
    if hasattr(module, "__path__"):
        importlib.import_module(f"benchmarks.{name}.__main__")
