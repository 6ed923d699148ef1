"""The page's pure modules under `node --test`, and the words of every finding."""

import asyncio
from pathlib import Path

TESTS = Path(__file__).parent / "modules"


async def test_pure_modules(node: str) -> None:
    tests = map(str, sorted(TESTS.glob("*.test.mjs")))
    pipe = asyncio.subprocess.PIPE
    run = await asyncio.create_subprocess_exec(node, "--test", *tests, stdout=pipe, stderr=asyncio.subprocess.STDOUT)
    output, _ = await run.communicate()
    assert run.returncode == 0, output.decode()
