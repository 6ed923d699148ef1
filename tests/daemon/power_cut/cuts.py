"""Cuts the power after every call of the workload, and starts the store on what the disk may hold then."""

import asyncio
import hashlib
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from daemon.errors import DaemonError, NotFound
from daemon.store.restore import restore
from daemon.store.store import Store
from tests.daemon.power_cut.disk import Disk, write_state
from tests.daemon.power_cut.recorded_calls import Call, read_calls, strace
from tests.daemon.power_cut.workload import BACKUP, MARK, OLD, RESTORED, STORE
from tests.daemon.save_paths import find_losses

State = dict[str, bytes | None]

REPOSITORY = Path(__file__).resolve().parents[3]


def record(folder: Path, module: str = "tests.daemon.power_cut.workload") -> tuple[Path, list[Call]]:
    """Run the workload in `folder` under strace; returns its root and its calls."""
    root, log = folder / "root", folder / "calls"
    root.mkdir()
    command = strace(log, sys.executable, "-m", module, str(root))
    subprocess.run(command, check=True, cwd=REPOSITORY, env={**os.environ, "PYTHONPATH": str(REPOSITORY)})
    return root, list(read_calls(log))


@dataclass(frozen=True)
class Loss:
    """What was wrong with a part of a state, after these acknowledgements."""

    part: str
    done: tuple[str, ...]
    what: list[str]

    @property
    def noticed(self) -> bool:
        """The store refuses to be written: it says that it is damaged, cut off, or cannot be opened."""
        return any(words in self.what[0] for words in ("not whole", "is damaged", "is empty", "cannot be opened"))

    def __str__(self) -> str:
        return f"{self.part}, {self.done[-1] if self.done else 'nothing'} acknowledged: {'; '.join(self.what)}"


@dataclass
class Cuts:
    """What was tried, and what was lost. `points`: calls after which the power was cut."""

    points: int = 0
    states: int = 0
    losses: list[Loss] = field(default_factory=list)
    _known: dict[bytes, list[str]] = field(default_factory=dict)

    def try_state(self, state: State, done: list[str]) -> None:
        """Check each part of a state, once for the same content and acknowledgements."""
        for part in (STORE, BACKUP, RESTORED, OLD):
            below = {name: content for name, content in state.items() if name.split("/")[0] == part}
            key = hashlib.sha256(repr((part, sorted(below.items()), sorted(done))).encode()).digest()
            if key not in self._known:
                self._known[key] = _losses(part, below, done)
                self.states += 1
                if self._known[key]:
                    self.losses.append(Loss(part, tuple(done), self._known[key]))


def cut_everywhere(
    root: Path, calls: list[Call], *, every: int = 1, random_states: int = 6, seed: int = 1
) -> Iterator[Cuts]:
    """Replay the calls; try states after each `every`-th one that changed the disk. Yields what was found so far."""
    disk, cuts, done, chance, changes = Disk(root), Cuts(), [], random.Random(seed), 0
    for call in calls:
        if "access" in call.name:
            path = Path(os.fsdecode(call.strings[0]))
            if path.parent == root / MARK:
                done.append(path.name)
            continue
        if not disk.replay(call):
            continue
        changes += 1
        if changes % every:
            continue
        cuts.points += 1
        for state in disk.states(random_states, chance):
            cuts.try_state(state, done)
        yield cuts


def _losses(part: str, state: State, done: list[str]) -> list[str]:
    shared = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as folder:
        write_state(state, Path(folder, "disk"))
        try:
            return asyncio.run(_CHECKS[part](Path(folder, "disk"), done))
        except DaemonError as error:
            return [f"cannot be opened: {error}"]


async def _check_store(folder: Path, done: list[str]) -> list[str]:
    return await find_losses(folder / STORE, done)


async def _check_backup(folder: Path, done: list[str]) -> list[str]:
    if not (folder / BACKUP).exists():
        return ["the backup is not there"] if "backup" in done else []
    restore(folder / BACKUP, folder / "tried")
    return await find_losses(folder / "tried", done)


async def _check_restored(folder: Path, done: list[str]) -> list[str]:
    """The whole backup, or nothing before the restore was acknowledged."""
    if "restore" not in done:
        store = Store(folder / RESTORED)
        begun = await store.listings.scans(1)
        await store.close()
        if not begun:
            left = [name for name in ("runs", "scans") if (folder / RESTORED / name).exists()]
            return [f"there is no store, but {left}"] if left else []
    return await find_losses(folder / RESTORED, [name for name in done if name != "closed"])


async def _check_old(folder: Path, done: list[str]) -> list[str]:
    if "old" not in done:
        return []
    store = Store(folder / OLD)
    try:
        return [] if (await store.scan("s")).name == "door" and store.fault is None else [f"{store.fault}"]
    except NotFound:
        return ["the scan of the older release is gone"]
    finally:
        await store.close()


_CHECKS = {STORE: _check_store, BACKUP: _check_backup, RESTORED: _check_restored, OLD: _check_old}
