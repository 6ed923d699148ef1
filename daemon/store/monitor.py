"""Watches the store while the daemon runs: anchors the audit log, and reports a store that is no longer sound.

It also warns of keys that end soon: a MES whose key ends at night is refused from then on.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial

from calibration.sentences.sentence import Sentence
from daemon.access.keys import KeyRecord
from daemon.errors import StorageError, StorageInconsistent
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus
from daemon.runtime.metrics import Labels, Metric
from daemon.runtime.tasks import InBackground, Service, end_task
from daemon.store.access_keys import AccessKeys
from daemon.store.consistency import StoreFault
from daemon.store.store import Store

log = logging.getLogger(__name__)

ANCHOR_S = 10.0
"""Interval of anchoring the audit log."""

CHECK_S = 60.0
"""Interval of comparing the files and the anchor with what is open."""

WHOLE_CHECK_S = 24 * 3600.0
"""Interval of reading every page and every row of the audit log; the first time CHECK_S after the start."""


@dataclass(eq=False)
class StoreMonitor(Service):
    """Background service. A fault is reported once: in the log and as event `store`; then by /ready and metrics."""

    store: Store
    events: EventBus
    _reported: StoreFault | None = field(default=None, init=False)
    _tasks: tuple[asyncio.Task[None], ...] = field(default=(), init=False)

    async def start(self) -> None:
        self._report(self.store.fault)
        self._tasks = (
            asyncio.create_task(_repeat(self.anchor, ANCHOR_S, ANCHOR_S)),
            asyncio.create_task(_repeat(self.check, CHECK_S, CHECK_S)),
            asyncio.create_task(_repeat(partial(self.check, whole=True), CHECK_S, WHOLE_CHECK_S)),
        )

    async def stop(self) -> None:
        for task in self._tasks:
            await end_task(task)

    async def anchor(self) -> None:
        """Write the anchor, unless the store has a fault. Raises StorageError."""
        try:
            await self.store.audit.anchor()
        except StorageInconsistent:
            await self.check()

    async def check(self, *, whole: bool = False) -> None:
        """As `Store.check`, and report what it finds. Raises StorageError."""
        self._report(await self.store.check(whole=whole))

    def warnings(self) -> list[str]:
        """The fault and what to do about it, for GET /ready."""
        fault = self.store.fault
        return [] if fault is None else [f"{fault.what}: {fault.fix}"]

    def families(self) -> Iterable[Metric]:
        sound = float(self.store.fault is None)
        return [Metric("handeyed_store_sound", "gauge", "0 while the store is damaged, cut off, moved or replaced.",
                       {(): sound})]  # fmt: skip

    def _report(self, fault: StoreFault | None) -> None:
        if fault == self._reported:
            return
        self._reported = fault
        if fault is None:
            log.warning("the store is sound again")
        else:
            log.error("%s: nothing is written and no run is started; %s", fault.what, fault.fix)
        self.events.publish("store", {"sound": fault is None, "what": fault and fault.what, "fix": fault and fault.fix})


async def _repeat(act: Callable[[], Awaitable[None]], first_s: float, interval_s: float) -> None:
    await asyncio.sleep(first_s)
    while True:
        try:
            await act()
        except StorageError as error:
            log.warning("the store could not be checked or anchored: %s", error)
        await asyncio.sleep(interval_s)


PERIOD_S = 60.0
WARN_DAYS = 30.0


def ending(records: Iterable[KeyRecord], now: str) -> list[KeyRecord]:
    """The valid keys that end, without those that a later key of their name has replaced."""
    latest = {record.name: record for record in records if record.valid(now)}
    return [record for record in latest.values() if record.expires_at is not None]


class KeyExpiry(InBackground):
    """Background service: knows when each key ends, as read each PERIOD_S."""

    def __init__(self, keys: AccessKeys, clock: Clock) -> None:
        self._keys, self._clock = keys, clock
        self._ending: list[KeyRecord] = []

    async def start(self) -> None:
        await self.look()
        await super().start()

    async def look(self) -> None:
        """Read the keys once; a store that fails is passed over: others report it."""
        with suppress(StorageError):
            self._ending = ending(await self._keys.all(), self._clock.timestamp())

    def warnings(self) -> list[str]:
        """One for each key that ends within WARN_DAYS."""
        now = self._clock.utc_now()
        left = ((record.name, str(record.expires_at), (_end_of(record) - now).days) for record in self._ending)
        return [
            Sentence("key-ends", name=name, at=at[:10], days=max(0, days))
            for name, at, days in left
            if days < WARN_DAYS
        ]

    def families(self) -> Iterable[Metric]:
        """When each key ends."""
        about = "When a key ends, in seconds since 1970, by its name; keys without an end are left out."
        ends: dict[Labels, float] = {(("name", record.name),): _end_of(record).timestamp() for record in self._ending}
        return [Metric("handeyed_key_expires_timestamp_seconds", "gauge", about, ends)]

    async def run(self) -> None:
        while True:
            await self._clock.sleep(PERIOD_S)
            await self.look()


def _end_of(record: KeyRecord) -> datetime:
    return datetime.fromisoformat(str(record.expires_at))
