"""Keys of every role, and headers that carry them."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from daemon.access.keys import id_of, new_key
from daemon.access.roles import ROLES, Role
from daemon.store.actor import AuditContext
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for

TEST = AuditContext("test", "test")


def bearer(key: str) -> dict[str, str]:
    return {"authorization": f"Bearer {key}"}


@asynccontextmanager
async def with_keys(
    folder: Path, parts: Parts | None = None, **changes: Any
) -> AsyncIterator[tuple[Bench, dict[str, str]]]:
    """A daemon with a key of each role, and some that are valid no more; `changes` of its settings by section."""
    async with serving(settings_for(folder, **changes), parts) as bench:
        desk = bench.application.key_service
        keys = {name: (await desk.add(name, role, TEST))[0] for name, role in ROLES.items()}
        keys["expired"] = (await desk.add("expired", Role.ADMIN, TEST, days=-1))[0]
        keys["revoked"] = (await desk.add("revoked", Role.ADMIN, TEST))[0]
        await desk.revoke("revoked", TEST)
        keys["invented"] = new_key(lambda n: "ab" * n)[0]
        keys["another secret"] = f"hek_{id_of(keys['admin'])}_{'0' * 64}"
        keys["no key at all"] = "let me in"
        yield bench, keys
