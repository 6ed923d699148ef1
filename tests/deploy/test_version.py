"""The version of a build: the tag's, or that of the commit, so that no two commits install as the same."""

import subprocess
from pathlib import Path

import pytest

from hatch_version import debian, version

CHANGELOG = "# Changelog\n\n## 0.2.0, unreleased\n\n## 0.1.0\n"


def git(root: Path, *arguments: str) -> str:
    who = ("-c", "user.name=Ann", "-c", "user.email=ann@example.org")
    ran = subprocess.run(["git", "-C", str(root), *who, *arguments], capture_output=True, text=True, check=True)
    return ran.stdout.strip()


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A repository with one commit."""
    git(tmp_path, "init", "--quiet")
    (tmp_path / "CHANGELOG.md").write_text(CHANGELOG)
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "--message", "Begin")
    return tmp_path


def short(root: Path) -> str:
    return git(root, "rev-parse", "--short=8", "HEAD")


def test_between_tags_it_is_the_next_version_the_number_of_commits_and_the_commit(source: Path) -> None:
    assert version(source, {}) == f"0.2.0.dev1+g{short(source)}"
    git(source, "commit", "--quiet", "--allow-empty", "--message", "Go on")
    assert version(source, {}) == f"0.2.0.dev2+g{short(source)}"
    (source / "CHANGELOG.md").write_text(CHANGELOG + "\n")
    assert version(source, {}) == f"0.2.0.dev2+g{short(source)}.dirty"


def test_at_a_tag_it_is_the_tag_and_after_it_a_later_one(source: Path) -> None:
    git(source, "tag", "v0.2.0")
    assert version(source, {}) == "0.2.0"
    git(source, "commit", "--quiet", "--allow-empty", "--message", "Go on")
    assert version(source, {}) == f"0.2.1.dev2+g{short(source)}"  # nobody has headed a new section yet


def test_without_git_it_is_what_is_given_or_packed(tmp_path: Path) -> None:
    (tmp_path / "CHANGELOG.md").write_text(CHANGELOG)
    assert version(tmp_path, {}) == "0.2.0.dev0+unknown"
    assert version(tmp_path, {"HANDEYED_VERSION": "0.2.0"}) == "0.2.0"
    (tmp_path / "PKG-INFO").write_text("Metadata-Version: 2.4\nName: handeyed\nVersion: 0.1.9\n")
    assert version(tmp_path, {}) == "0.1.9"


@pytest.mark.parametrize(
    ("python", "dpkg"),
    [
        ("0.2.0", "0.2.0"),
        ("0.2.0.dev1056+g00fb5088", "0.2.0~dev1056+g00fb5088"),
        ("0.2.0.dev1056+g00fb5088.dirty", "0.2.0~dev1056+g00fb5088.dirty"),
        ("0.2.0rc1", "0.2.0~rc1"),
        ("0.2.0.dev3+gab1", "0.2.0~dev3+gab1"),  # the commit's letters and digits stay
    ],
)
def test_dpkg_sorts_a_build_before_its_release(python: str, dpkg: str) -> None:
    assert debian(python) == dpkg
