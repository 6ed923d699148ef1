"""Warns of keys that end soon: a MES whose key ends at night is refused from then on."""

from collections.abc import Iterable
from contextlib import suppress
from datetime import datetime

from calibration.sentences.sentence import Sentence
from daemon.access.keys import KeyRecord
from daemon.errors import StorageError
from daemon.runtime.clock import Clock
from daemon.runtime.metrics import Labels, Metric
from daemon.runtime.tasks import InBackground
from daemon.store.access_keys import AccessKeys

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
