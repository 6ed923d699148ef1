"""Ends the requests in progress of a key that has ended (revoked, expired, or rotated out), or of a browser session.

Keys change in other processes, too (`handeyed keys`), so the table is read while there are such requests.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from daemon.access.errors import KeyMissing
from daemon.access.roles import LOCAL, LOCAL_READER, NOBODY, SERVICE, Caller
from daemon.errors import StorageError
from daemon.runtime.clock import Clock
from daemon.runtime.tasks import InBackground
from daemon.store.access_keys import AccessKeys
from daemon.store.sign_in import BrowserSessions

CHECK_S = 0.5
"""Interval of reading the keys."""

OnEnd = Callable[[KeyMissing], None]


class KeyWatch(InBackground):
    """Background service: knows the requests in progress and their callers."""

    def __init__(self, keys: AccessKeys, sessions: BrowserSessions, clock: Clock) -> None:
        self._keys, self._sessions, self._clock = keys, sessions, clock
        self._requests: dict[object, tuple[Caller, OnEnd]] = {}

    @contextmanager
    def watch(self, caller: Caller, on_end: OnEnd) -> Iterator[None]:
        """Call `on_end` once when the caller's key ends during the block; for LOCAL, when the first key is created."""
        request = object()
        if caller not in (NOBODY, SERVICE):
            self._requests[request] = caller, on_end
        try:
            yield
        finally:
            self._requests.pop(request, None)

    async def run(self) -> None:
        while True:
            await self._clock.sleep(CHECK_S)
            if self._requests:
                with suppress(StorageError):  # reported by whoever needs the store
                    await self._check()

    async def _check(self) -> None:
        records = {record.id: record for record in await self._keys.all()}
        by_session = any(caller.session for caller, _ in self._requests.values())
        found = (await self._sessions.all()).values() if by_session else ()
        now = self._clock.timestamp()
        sessions = {session.id for session in found if session.valid(now)}
        for request, (caller, on_end) in list(self._requests.items()):
            record = records.get(caller.key_id)
            if caller in (LOCAL, LOCAL_READER):
                why = "there are keys now: this needs one" if records else None
            elif record is None:
                why = f"the key of {caller.name!r} is not known"
            elif caller.session and caller.session not in sessions:
                why = "this session has ended"
            else:
                why = None if record.valid(now) else f"the key of {caller.name!r} is {record.state(now)}"
            if why is not None:
                self._requests.pop(request, None)
                on_end(KeyMissing(why))
