"""Two daemons never share a store."""

from pathlib import Path

import pytest

from daemon.errors import StorageInUse
from daemon.store.store import Store


async def test_a_second_daemon_on_the_same_store_is_refused_until_the_first_has_closed(tmp_path: Path) -> None:
    first = Store(tmp_path)
    with pytest.raises(StorageInUse, match="in use by another handeyed: stop that one"):
        Store(tmp_path)
    await first.close()
    await Store(tmp_path).close()


async def test_a_store_that_cannot_be_opened_is_not_held(tmp_path: Path) -> None:
    (tmp_path / "handeyed.sqlite").write_bytes(b"this is no database, but long enough to look like one" * 20)
    for _ in range(2):
        with pytest.raises(Exception, match=r"handeyed\.sqlite"):
            Store(tmp_path)
