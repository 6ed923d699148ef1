"""A power cut at any call loses nothing that was acknowledged; the trial finds a store that does not synchronise."""

import random
import shutil
from pathlib import Path

import pytest

from tests.daemon.power_cut.cuts import Cuts, cut_everywhere, record
from tests.daemon.power_cut.disk import Disk
from tests.daemon.power_cut.recorded_calls import Call

pytestmark = pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not here (Debian: strace)")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Call]]:
    return record(tmp_path_factory.mktemp("power"))


def last_of(recorded: tuple[Path, list[Call]], leave_out: str = "", every: int = 7) -> Cuts:
    """The cuts after every so manieth change, as if the calls `leave_out` had never been made."""
    root, calls = recorded
    kept = [call for call in calls if call.name != leave_out]
    *_, cuts = cut_everywhere(root, kept, every=every, random_states=2)
    return cuts


@pytest.mark.slow
def test_nothing_acknowledged_is_lost(recorded: tuple[Path, list[Call]]) -> None:
    cuts = last_of(recorded)
    assert cuts.points > 50
    assert cuts.states > 100
    assert [str(loss) for loss in cuts.losses] == []


@pytest.mark.slow
def test_a_store_that_does_not_synchronise_files_and_folders_is_found(recorded: tuple[Path, list[Call]]) -> None:
    found = {what for loss in last_of(recorded, "fsync", every=19).losses for what in loss.what}
    assert "picture was acknowledged and is not there" in found


@pytest.mark.slow
def test_a_database_that_a_disk_did_not_keep_is_noticed_by_its_anchor(recorded: tuple[Path, list[Call]]) -> None:
    """SQLite's synchronisation is a lie here: what was acknowledged before the last anchor and is lost, is noticed."""
    losses = last_of(recorded, "fdatasync").losses
    assert any(loss.part == "store" for loss in losses)
    anchored = [loss for loss in losses if loss.part == "store" and "anchor" in loss.done]
    assert anchored
    assert [str(loss) for loss in anchored if not loss.noticed] == []


def call(name: str, *arguments: object, result: int = 0) -> Call:
    strings = tuple(argument for argument in arguments if isinstance(argument, bytes))
    return Call(name, tuple(str(argument) for argument in arguments), strings, result)


def contents_after(*calls: Call) -> list[dict[str, bytes | None]]:
    """Every different state after these calls below /r."""
    disk, states = Disk(Path("/r")), []
    for each in calls:
        disk.replay(each)
    for state in disk.states(60, random.Random(1)):
        if state not in states:
            states.append(state)
    return states


NEW = call("openat", "AT_FDCWD", b"/r/new", "O_WRONLY|O_CREAT", result=3)
FOLDER = call("openat", "AT_FDCWD", b"/r", "O_RDONLY|O_DIRECTORY", result=4)
WRITE, SYNC, SYNC_FOLDER = call("write", 3, b"ab" * 500, result=1000), call("fsync", 3), call("fsync", 4)
RENAME = call("rename", b"/r/new", b"/r/old")


def test_what_was_synchronised_is_kept_and_nothing_else_is_sure() -> None:
    whole = b"ab" * 500
    assert {} in contents_after(NEW, WRITE, SYNC)
    assert contents_after(NEW, WRITE, SYNC, FOLDER, SYNC_FOLDER) == [{"new": whole}]
    torn = contents_after(NEW, FOLDER, SYNC_FOLDER, WRITE)
    assert {"new": b""} in torn
    assert {"new": whole[:512]} in torn
    assert {"new": bytes(512) + whole[512:]} in torn


def test_a_rename_reaches_the_disk_or_not() -> None:
    states = contents_after(NEW, WRITE, SYNC, FOLDER, SYNC_FOLDER, RENAME)
    assert sorted([*state] for state in states) == [["new"], ["old"]]


def test_a_rename_between_folders_is_in_both_or_in_none() -> None:
    mkdir, move = call("mkdir", b"/r/sub"), call("rename", b"/r/new", b"/r/sub/new")
    states = contents_after(NEW, WRITE, SYNC, mkdir, FOLDER, SYNC_FOLDER, move)
    assert sorted(sorted(state) for state in states) == [["new", "sub"], ["sub", "sub/new"]]
