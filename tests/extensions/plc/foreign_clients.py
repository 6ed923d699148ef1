"""Modbus programs of others, run as commands."""

import asyncio
import os
import shutil

import pytest

from tests.support.waiting import LIMIT_S

needs_mbpoll = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not here: apt-get install mbpoll")


async def output_of(*command: str, **environment: str) -> str:
    """What it prints; fails with all of it when it fails."""
    process = await asyncio.create_subprocess_exec(
        *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT, env={**os.environ, **environment}
    )
    out, _ = await asyncio.wait_for(process.communicate(), LIMIT_S)
    assert process.returncode == 0, out.decode()
    return out.decode()
