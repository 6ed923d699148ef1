"""A restore makes a store in an empty place from a whole backup, or changes nothing."""

import json
import os
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest

from daemon.errors import BackupUnusable, StorageError, StorageInUse
from daemon.store import restore as restore_module
from daemon.store.backup import MANIFEST
from daemon.store.database import DATABASE_NAME, SCHEMA_VERSION
from daemon.store.opening import LOCK_NAME
from daemon.store.restore import restore
from daemon.store.store import Store
from tests.daemon.cli.running import handeyed
from tests.daemon.store.backups import PICTURE, a_backup, a_tar, config_in, contents_of, fill_store, names_of_scans


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def names_in(folder: Path) -> list[str]:
    return [entry.name for entry in folder.iterdir()]


async def test_what_was_backed_up_is_there_and_closed_to_others(tmp_path: Path) -> None:
    file, store = await a_backup(tmp_path / "old", tmp_path / "all.tar"), tmp_path / "new"
    assert restore(file, store) == 3
    assert file.stat().st_mode & 0o777 == 0o600
    assert (store / "runs" / "r" / "view_000.png").read_bytes() == PICTURE
    assert await names_of_scans(store) == ["door"]
    for path in (store, *store.rglob("*")):
        assert not path.stat().st_mode & 0o007, path


async def test_a_backup_without_hashes_of_an_earlier_release_is_restored(tmp_path: Path) -> None:
    contents = contents_of(await a_backup(tmp_path / "old", tmp_path / "all.tar"))
    contents[MANIFEST] = json.dumps({"schema": SCHEMA_VERSION, "format": 1, "made_at": ""}).encode()
    restore(a_tar(tmp_path / "earlier.tar", dict(contents)), tmp_path / "new")
    assert await names_of_scans(tmp_path / "new") == ["door"]


@pytest.mark.parametrize(
    "name", ["handeyed.sqlite", "handeyed.sqlite-wal", "handeyed.sqlite.schema-3.backup", "audit-anchor.json",
             "audit-anchor.json.unmet", "runs", "scans"]
)  # fmt: skip
async def test_a_place_with_anything_of_a_store_is_left_as_it_is(tmp_path: Path, name: str) -> None:
    file, store = await a_backup(tmp_path / "old", tmp_path / "all.tar"), tmp_path / "new"
    there = store / name / "r1" / "view_000.png" if name in ("runs", "scans") else store / name
    there.parent.mkdir(parents=True)
    there.write_bytes(b"something dear")
    with pytest.raises(BackupUnusable, match=f"holds a store already, or a part of one: {name}"):
        restore(file, store)
    assert {k: v for k, v in files_in(store).items() if k != LOCK_NAME} == {
        str(there.relative_to(store)): b"something dear"
    }


async def test_a_link_that_leads_nowhere_is_something(tmp_path: Path) -> None:
    file, store = await a_backup(tmp_path / "old", tmp_path / "all.tar"), tmp_path / "new"
    store.mkdir()
    (store / "runs").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(BackupUnusable, match="runs"):
        restore(file, store)
    assert not (tmp_path / "elsewhere").exists()


async def test_the_store_of_a_running_daemon_is_refused(tmp_path: Path) -> None:
    file, store = await a_backup(tmp_path / "old", tmp_path / "all.tar"), Store(tmp_path / "new")
    with pytest.raises(StorageInUse):
        restore(file, tmp_path / "new")
    await store.close()


Change = Callable[[dict[str, bytes | tarfile.TarInfo]], object]


def member(name: str, kind: bytes, target: str = "") -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.linkname = kind, target
    return info


def manifest(**values: object) -> bytes:
    return json.dumps({"schema": SCHEMA_VERSION, "format": 1, **values}).encode()


SPOILT: dict[str, tuple[Change, str]] = {
    "outside": (lambda c: c.update({"../evil": b"x"}), "is no backup"),
    "an absolute name": (lambda c: c.update({"/tmp/evil": b"x"}), "is no backup"),
    "a file beside": (lambda c: c.update({"handeyed.sqlite-wal": b"x"}), "is no backup"),
    "a hidden file": (lambda c: c.update({"runs/r/.view": b"x"}), "is no backup"),
    "too deep": (lambda c: c.update({"runs/r/s/t": b"x"}), "is no backup"),
    "not in the manifest": (lambda c: c.update({"runs/r/view_001.png": b"x"}), "damaged: runs/r/view_001.png"),
    "a file is missing": (lambda c: c.pop("runs/r/view_000.png"), "damaged: runs/r/view_000.png"),
    "a picture is changed": (lambda c: c.update({"runs/r/view_000.png": PICTURE[:-1] + b"x"}), "damaged: runs/r"),
    "a link": (lambda c: c.update({"runs/r/a": member("runs/r/a", tarfile.SYMTYPE, "/etc")}), "is no backup"),
    "a hard link": (lambda c: c.update({"runs/r/a": member("runs/r/a", tarfile.LNKTYPE, "/etc/passwd")}), "no backup"),
    "a pipe": (lambda c: c.update({"runs/r/a": member("runs/r/a", tarfile.FIFOTYPE)}), "is no backup"),
    "a folder": (lambda c: c.update({"runs/r": member("runs/r", tarfile.DIRTYPE)}), "is no backup"),
    "no manifest": (lambda c: c.pop(MANIFEST), "its end is missing"),
    "no database": (lambda c: c.pop(DATABASE_NAME), "is no backup"),
    "newer": (lambda c: c.update({MANIFEST: manifest(schema=SCHEMA_VERSION + 1)}), "newer handeyed"),
    "a bad manifest": (lambda c: c.update({MANIFEST: b"[" * 100_000}), "cannot be read"),
    "a number for files": (lambda c: c.update({MANIFEST: manifest(format=2, files=7)}), "cannot be read"),
    "no database inside": (
        lambda c: c.update({DATABASE_NAME: b"this is no database " * 99, MANIFEST: manifest()}),
        "damaged",
    ),
    "the log is behind its anchor": (
        lambda c: c.update({"audit-anchor.json": b'{"sequence": 9, "hash": "x"}', MANIFEST: manifest()}),
        "row 9 was written",
    ),
}


@pytest.mark.parametrize("what", SPOILT)
async def test_a_spoilt_backup_is_refused_and_leaves_nothing(tmp_path: Path, what: str) -> None:
    change, says = SPOILT[what]
    contents: dict[str, bytes | tarfile.TarInfo] = dict(contents_of(await a_backup(tmp_path / "o", tmp_path / "a.tar")))
    change(contents)
    spoilt, store = a_tar(tmp_path / "spoilt.tar", contents), tmp_path / "new" / "store"
    refused = handeyed("restore", spoilt, config_in(tmp_path / "new"))
    assert (refused.status, says in refused.err) == (1, True), refused.err
    assert names_in(store) == [LOCK_NAME]
    assert not (tmp_path / "new" / "evil").exists()


async def test_a_backup_cut_off_anywhere_or_changed_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    file, store = await a_backup(tmp_path / "old", tmp_path / "all.tar"), tmp_path / "new"
    whole = file.read_bytes()
    end = whole.rindex(b"}") + 1  # what follows the manifest is padding
    spoilt = [whole[:size] for size in range(0, end, 3071)]
    spoilt += [whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :] for at in range(156, end, 4973)]
    for number, content in enumerate(spoilt):
        (tmp_path / "spoilt.tar").write_bytes(content)
        try:
            restore(tmp_path / "spoilt.tar", store)
        except (BackupUnusable, StorageError):
            assert names_in(store) == [LOCK_NAME], number
            continue
        assert files_in(store)["runs/r/view_000.png"] == PICTURE  # a bit that says nothing, e.g. of padding
        assert await names_of_scans(store) == ["door"]
        store = tmp_path / f"new{number}"


@pytest.mark.parametrize("source", ["nowhere.tar", "pipe", "folder"])
def test_what_is_no_file_is_refused(tmp_path: Path, source: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    with pytest.raises((BackupUnusable, StorageError), match=source):
        restore(tmp_path / source, tmp_path / "new")


@pytest.mark.parametrize("nth", range(4))
async def test_a_restore_interrupted_at_any_move_is_finished_by_the_next_that_opens_the_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nth: int
) -> None:
    """A power cut between two renames: the backup was checked, so the store is the backup's, or nothing yet."""
    file, store, moves = await a_backup(tmp_path / "old", tmp_path / "all.tar"), tmp_path / "new", 0
    rename = Path.rename

    def interrupted(path: Path, target: Path) -> Path:
        nonlocal moves
        moves += 1
        if moves > nth:
            raise KeyboardInterrupt
        return rename(path, target)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(restore_module.Path, "rename", interrupted)
        restore(file, store)
    assert not (store / DATABASE_NAME).exists()
    assert await names_of_scans(store) == ([] if nth == 0 else ["door"])
    assert not [name for name in names_in(store) if name.startswith(".")]


async def test_a_restore_that_cannot_be_finished_overwrites_nothing(tmp_path: Path) -> None:
    await fill_store(tmp_path / "store")
    (tmp_path / "store" / ".restored").mkdir()
    (tmp_path / "store" / ".restored" / DATABASE_NAME).write_bytes(b"another")
    before = files_in(tmp_path / "store")
    with pytest.raises(StorageError, match="is there already"):
        Store(tmp_path / "store")
    assert files_in(tmp_path / "store") == before


def test_keys_of_the_backup_can_be_revoked_with_the_restore(tmp_path: Path) -> None:
    here, there, file = config_in(tmp_path / "here"), config_in(tmp_path / "there"), tmp_path / "all.tar"
    handeyed("keys", "add", here, "Ann", "--role", "admin")
    handeyed("backup", here, "--out", file)
    done = handeyed("restore", file, there, "--revoke-keys")
    assert (done.status, "revoked: " in done.out) == (0, True), done.err
    assert [key["state"] for key in json.loads(handeyed("keys", "list", there, "--json").out)] == ["revoked"]
