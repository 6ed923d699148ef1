"""Settings, backups and tar files for tests of backup and restore."""

import io
import tarfile
from collections.abc import Iterable
from pathlib import Path

from daemon.model.records import ScanRecord
from daemon.store.backup import back_up
from daemon.store.listings import ScanListing
from daemon.store.opening import open_offline
from daemon.store.store import Store
from tests.daemon.daemon_process import SETTINGS

AT = "2026-11-21T09:00:00.000Z"
PICTURE = b"\x89PNG" + bytes(range(256)) * 40


def config_in(folder: Path) -> Path:
    """The settings of a daemon whose store is `folder`/store."""
    folder.mkdir(exist_ok=True)
    file = folder / "handeyed.toml"
    file.write_text(SETTINGS)
    return file


async def fill_store(folder: Path, scans: Iterable[str] = ("door",)) -> None:
    """A store with scans by name, the pictures of a run, and an anchored audit log."""
    store = Store(folder)
    for number, name in enumerate(scans):
        await store.save_scan(ScanRecord(f"s{number}", AT, name))
    await store.write_file(store.run_folder("r") / "view_000.png", [PICTURE])
    await store.audit.anchor()
    await store.close()


async def names_of_scans(folder: Path) -> list[str]:
    """The scans in a store, oldest first."""
    store = Store(folder)
    try:
        found = await store.listings.scans(500)
        return [one.scan.name for one in found if isinstance(one, ScanListing)][::-1]
    finally:
        await store.close()


async def a_backup(folder: Path, file: Path) -> Path:
    """A backup of a filled store in `folder`."""
    await fill_store(folder)
    with open_offline(folder) as database:
        back_up(folder, database, file, AT)
    return file


def a_tar(file: Path, contents: dict[str, bytes | tarfile.TarInfo]) -> Path:
    """A tar file of contents by name, or of members that are no files."""
    with tarfile.open(file, "w") as archive:
        for name, content in contents.items():
            if isinstance(content, tarfile.TarInfo):
                archive.addfile(content)
                continue
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return file


def contents_of(file: Path) -> dict[str, bytes]:
    """The contents of a tar file by name."""
    with tarfile.open(file) as archive:
        return {member.name: archive.extractfile(member).read() for member in archive}  # type: ignore[union-attr]
