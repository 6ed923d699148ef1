"""docs/openapi.json in other languages: clients generated for Python, TypeScript and R ask the running daemon.

None is shipped. The generators are taken from HANDEYED_NODE_MODULES (openapi-typescript, openapi-fetch, typescript) and
HANDEYED_GENERATORS, the `bin` of a virtual environment with openapi-python-client and openapi-generator-cli.
"""

import asyncio
import json
import os
import shutil
from asyncio.subprocess import PIPE, STDOUT
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import serving, settings_for
from tests.daemon.fakes import FLANGE_T_CAMERA

pytestmark = pytest.mark.slow

OPENAPI = Path(__file__).parents[2] / "docs" / "openapi.json"
ASK = Path(__file__).parent / "generated"
GENERATORS = Path(os.environ.get("HANDEYED_GENERATORS", ""))
MODULES = Path(os.environ.get("HANDEYED_NODE_MODULES", ""))

TYPESCRIPT = ("--strict", "--target", "es2022", "--module", "nodenext", "--skipLibCheck")


async def run(*command: str | Path, cwd: Path) -> str:
    """What a program prints; fails with that unless its exit status is 0."""
    java = {"JAVA_TOOL_OPTIONS": "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC"}  # it runs once, for seconds
    process = await asyncio.create_subprocess_exec(*command, cwd=cwd, stdout=PIPE, stderr=STDOUT, env=os.environ | java)
    try:
        printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
    assert process.returncode == 0, printed.decode()
    return printed.decode()


def needed(program: Path | str, packages: str) -> Path:
    """The path of a program; skips with the names of the packages that have it."""
    found = shutil.which(program)
    if found is None:
        pytest.skip(f"{Path(program).name} is not here: install {packages}")
    return Path(found)


async def python(folder: Path, url: str) -> str:
    generator = needed(GENERATORS / "openapi-python-client", "openapi-python-client, and set HANDEYED_GENERATORS")
    options = ("--path", OPENAPI, "--output-path", folder / "generated", "--meta", "none")
    await run(generator, "generate", *options, cwd=folder)
    return await run(GENERATORS / "python", ASK / "ask.py", url, folder, cwd=folder)


async def typescript(folder: Path, url: str) -> str:
    node = needed("node", "nodejs")
    for package in ("openapi-typescript", "openapi-fetch", "typescript"):
        if not (MODULES / package).is_dir():
            pytest.skip(f"npm's {package} is not here: npm install {package}, and set HANDEYED_NODE_MODULES")
    (folder / "node_modules").symlink_to(MODULES)
    (folder / "package.json").write_text('{"type": "module"}')
    shutil.copy(ASK / "ask.ts", folder)
    await run(node, "node_modules/openapi-typescript/bin/cli.js", OPENAPI, "-o", "schema.ts", cwd=folder)
    await run(node, "node_modules/typescript/bin/tsc", *TYPESCRIPT, "ask.ts", cwd=folder)
    return await run(node, "ask.js", url, cwd=folder)


async def r(folder: Path, url: str) -> str:
    generator = needed(GENERATORS / "openapi-generator-cli", "openapi-generator-cli, and set HANDEYED_GENERATORS")
    needed("java", "openjdk-17-jre-headless")
    rscript = needed("Rscript", "r-base-core r-cran-r6 r-cran-jsonlite r-cran-httr r-cran-base64enc r-cran-stringr")
    options = ("-g", "r", "--library", "httr", "-i", OPENAPI, "-o", "client")
    await run(generator, "generate", *options, cwd=folder)
    for file in (folder / "client" / "R").iterdir():  # the generator's template has "< =" for exclusiveMinimum
        file.write_text(file.read_text().replace("< =", "<=").replace("> =", ">="))
    (folder / "library").mkdir()
    installing = ("--no-docs", "--no-test-load", "--no-byte-compile", "--library=library", "client")
    await run("R", "CMD", "INSTALL", *installing, cwd=folder)
    return await run(rscript, "--vanilla", ASK / "ask.R", url, "library", cwd=folder)


@pytest.mark.parametrize("language", [python, typescript, r], ids=lambda one: one.__name__)
async def test_a_generated_client_reads_the_daemons_documents(
    language: Callable[[Path, str], Awaitable[str]], tmp_path: Path
) -> None:
    (client := tmp_path / "client").mkdir()
    async with serving(settings_for(tmp_path / "store")) as bench:
        await apply_calibration(bench, "cal-1")
        printed = await language(client, bench.url)
    answer = json.loads(printed.splitlines()[-1])
    assert (answer["status"], answer["listed"]) == ("alive", ["cal-1"])
    assert answer["translation_mm"] == pytest.approx(FLANGE_T_CAMERA[:3, 3])
