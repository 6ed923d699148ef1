"""Saves everything once, in a process that strace watches: `python -m tests.daemon.power_cut.workload FOLDER`.

What is acknowledged is marked by `os.access` of a name that does not exist, which strace records in order.
"""

import asyncio
import os
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

from daemon.store.backup import back_up
from daemon.store.database import DATABASE_NAME, MIGRATIONS
from daemon.store.opening import open_offline
from daemon.store.restore import restore
from daemon.store.retention import AGES_NAME, RunAges
from daemon.store.store import Store
from registration.io.durable_file import fsync_path
from tests.daemon.records import AT
from tests.daemon.save_paths import save_steps

MARK = "acknowledged"
STORE, BACKUP, RESTORED, OLD = "store", "all.tar", "restored", "old"


def acknowledge(root: Path, what: str) -> None:
    """Mark in the record that `what` was acknowledged."""
    os.access(root / MARK / what, os.F_OK)


async def work(root: Path) -> None:
    store = Store(root / STORE)
    for name, step in save_steps(store).items():
        await step()
        acknowledge(root, name)
    ages = RunAges().after(3600.0, "r")
    await store.write_file(store.folder / AGES_NAME, [ages.json()])
    acknowledge(root, "ages")
    await store.close()
    acknowledge(root, "closed")
    with open_offline(root / STORE) as database:
        back_up(root / STORE, database, root / BACKUP, AT)
    acknowledge(root, "backup")
    restore(root / BACKUP, root / RESTORED)
    acknowledge(root, "restore")
    make_old_store(root / OLD)
    acknowledge(root, "old")
    await Store(root / OLD).close()
    acknowledge(root, "migrated")


def make_old_store(folder: Path) -> None:
    """A store of the schema before this one, durably."""
    folder.mkdir()
    fsync_path(folder.parent)
    with closing(sqlite3.connect(folder / DATABASE_NAME)) as old:
        for number, migration in enumerate(MIGRATIONS[:-1], start=1):
            old.executescript(f"BEGIN; {migration} PRAGMA user_version = {number}; COMMIT;")
        old.execute("INSERT INTO scans (id, created_at, name, refine) VALUES ('s', ?, 'door', 0)", (AT,))
        old.commit()
    fsync_path(folder)


if __name__ == "__main__":
    asyncio.run(work(Path(sys.argv[1])))
