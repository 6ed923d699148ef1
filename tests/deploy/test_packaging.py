"""What is installed beside what: the lock satisfies pyproject.toml, and nobody else provides our names."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
ROOMS = [*PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]["rooms"], "handeyed"]


def _pins(lock: str) -> list[tuple[str, str]]:
    """(name, version) of every entry; a library may have one version for each range of Pythons."""
    text = (ROOT / "deploy" / lock).read_text()
    found = re.findall(r"^([\w.-]+)==([^\s;]+)", text, re.MULTILINE)
    return [(canonicalize_name(name), version) for name, version in found]


@pytest.mark.parametrize(
    ("lock", "wanted"),
    [
        ("requirements.lock", PYPROJECT["project"]["dependencies"]),
        ("requirements.lock", PYPROJECT["project"]["optional-dependencies"]["las"]),  # openapi.json names LAZ
        ("build.lock", PYPROJECT["build-system"]["requires"]),
        ("build.lock", PYPROJECT["dependency-groups"]["build"]),
    ],
)
def test_the_lock_satisfies_pyproject(lock: str, wanted: list[str]) -> None:
    pins = _pins(lock)
    for line in wanted:
        requirement = Requirement(line)
        versions = [version for name, version in pins if name == canonicalize_name(requirement.name)]
        assert versions, f"{line} is not in deploy/{lock}: run `make lock`"
        for version in versions:
            assert requirement.specifier.contains(version), f"deploy/{lock} has {version}, not {line}: run `make lock`"


@pytest.mark.parametrize("lock", ["requirements.lock", "build.lock"])
def test_every_pin_has_its_hashes_and_no_address_is_inside(lock: str) -> None:
    text = (ROOT / "deploy" / lock).read_text()

    entries = re.split(r"^(?=[a-z0-9][\w.-]*==)", text, flags=re.MULTILINE)[1:]
    assert len(entries) == len(_pins(lock))
    assert all("--hash=sha256:" in entry for entry in entries)
    assert not re.search(r"https?://|file:|--index|--find-links", text)


def test_no_other_distribution_provides_our_names() -> None:
    providers = metadata.packages_distributions()

    for room in ROOMS:
        others = {name for name in providers.get(room, []) if canonicalize_name(name) != "handeyed"}
        assert not others, f"{others} also installs '{room}': use a virtual environment of its own"


def test_every_room_is_in_the_wheel_and_every_import_contract() -> None:
    rooms = sorted(
        path.parent.name for path in ROOT.glob("*/__init__.py") if path.parent.name not in ("tests", "benchmarks")
    )

    assert sorted(ROOMS) == rooms
    assert sorted(PYPROJECT["tool"]["importlinter"]["root_packages"]) == rooms
    assert sorted(PYPROJECT["tool"]["mypy"]["packages"]) == rooms


def test_every_room_is_in_what_an_installation_is_built_from() -> None:
    sdist = PYPROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    built = {"the sdist": {path.removeprefix("/") for path in sdist}}
    for script in ("install.sh", "venv.sh"):
        (named,) = re.findall(
            r"\b(?:find|cp -R) (calibration [a-z_ ]+) hatch_build", (ROOT / "deploy" / script).read_text()
        )
        built[script] = set(named.split())

    assert {name: missing for name, rooms in built.items() if (missing := sorted({*ROOMS} - rooms))} == {}


def test_every_import_is_a_declared_dependency() -> None:
    """A library that is only there because another one brings it would vanish with it."""
    project = PYPROJECT["project"]
    given = (project["dependencies"], *project["optional-dependencies"].values())
    declared = {canonicalize_name(Requirement(line).name) for lines in given for line in lines}
    providers = metadata.packages_distributions()
    missing: dict[str, set[str]] = {}
    for room in ROOMS:
        for file in (ROOT / room).rglob("*.py"):
            for module in re.findall(r"^\s*(?:import|from) ([a-zA-Z_]\w*)", file.read_text(), re.MULTILINE):
                names = {canonicalize_name(name) for name in providers.get(module, ())}
                if names and not names & (declared | {"handeyed"} | BROUGHT.get(module, set())):
                    missing.setdefault(module, set()).add(str(file.relative_to(ROOT)))
    assert not missing


BROUGHT = {"starlette": {"starlette"}}
"""FastAPI re-exports Starlette and pins the version it works with."""
