"""Subscription groups: watched resources, and the changes not yet sent."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from mock_robot.rws import documents
from mock_robot.rws.context import RequestContext
from mock_robot.rws.exchange import Item, RwsRequest
from mock_robot.rws.refusals import BAD_ARGUMENT, RwsRefused
from mock_robot.rws.routes import answer_request
from mock_robot.rws.sessions import Session
from mock_robot.rws.world import World

MAX_RESOURCES = 1000
MAX_HIGH_PRIORITY = 64
PERIODS_S = {0: 5.0, 1: 0.2, 2: 0.02}
"""Polling period in seconds of low, medium and high priority."""


class Events(NamedTuple):
    """A kind of event: a change of these values of the answer to a GET of `path`. `facet`: of the event's link."""

    path: str
    kind: str
    facet: str
    names: tuple[str, ...]


EVENTS = (
    Events("/rw/panel/ctrl-?state", "pnl-ctrlstate-ev", "", ("ctrlstate",)),
    Events("/rw/panel/opmode", "pnl-opmode-ev", "", ("opmode",)),
    Events("/rw/panel/speedratio", "pnl-speedratio-ev", "", ("speedratio",)),
    Events("/rw/rapid/execution", "rap-ctrlexecstate-ev", ";ctrlexecstate", ("ctrlexecstate",)),
    Events("/rw/iosystem/signals/.+", "ios-signalstate-ev", ";state", ("lvalue", "lstate")),
    Events("/rw/elog/0", "elog-message-ev", "", ("seqnum",)),
    Events("/rw/rapid/symbol/data/.+", "rap-data", ";value", ("value",)),
    Events("/rw/rapid/symbol/RAPID/.+/data", "rap-value-ev", ";value", ("value",)),
)
HIGH_PRIORITY = ("ios-signalstate-ev", "rap-data", "rap-value-ev")


@dataclass
class WatchedResource:
    """One resource: `read` returns its current values, `sent` are those last sent to the client."""

    kind: str
    href: str
    priority: int
    read: Callable[[], list[Item]]
    sent: list[Item]
    due_s: float = 0.0

    def changes(self) -> list[Item]:
        """Items that changed since the last call; new log entries one by one, oldest first."""
        try:
            now = self.read()
        except RwsRefused:  # while the program restarts
            return []
        new = [item for item in reversed(now) if item not in self.sent]
        self.sent = now
        return new


@dataclass
class SubscriptionGroup:
    """One subscription. `taken`: its socket was opened, which its address allows once."""

    number: int
    session: Session
    watched: list[WatchedResource]
    taken: bool = False
    mute: bool = False

    def events(self, now_s: float) -> list[str]:
        """Messages for everything that changed."""
        messages = []
        for each in self.watched:
            if now_s >= each.due_s:
                each.due_s = now_s + PERIODS_S[each.priority]
                for item in each.changes():
                    href = item.title if each.kind == "elog-message-ev" else each.href
                    messages.append(documents.event(each.kind, href, self.number, item))
        return [] if self.mute else messages


@dataclass
class Subscriptions:
    world: World
    version: int
    groups: dict[int, SubscriptionGroup] = field(default_factory=dict, init=False)
    _number: int = field(default=0, init=False)

    def create(self, session: Session, form: Mapping[str, str]) -> SubscriptionGroup:
        """Create a group from a form: resources=1, 1=/rw/..., 1-p=1. Raises RwsRefused."""
        numbers = [key for key in form if key.isdecimal()]
        if not numbers or "resources" not in form or len(numbers) > MAX_RESOURCES:
            raise RwsRefused(BAD_ARGUMENT, "Invalid resource URI in Create Subscription request")
        watched = [self._resource(session, form[number], form.get(f"{number}-p", "")) for number in numbers]
        if sum(each.priority == 2 for each in watched) > MAX_HIGH_PRIORITY:
            raise RwsRefused(BAD_ARGUMENT, f"More than {MAX_HIGH_PRIORITY} resources of high priority")
        self._number += 1
        group = self.groups[self._number] = SubscriptionGroup(self._number, session, watched)
        return group

    def delete(self, number: int) -> bool:
        """Delete a group; returns whether it existed."""
        return self.groups.pop(number, None) is not None

    def end_session(self, session: Session) -> None:
        self.groups = {number: group for number, group in self.groups.items() if group.session is not session}

    def forget(self, *, silently: bool = False) -> None:
        """End all groups; `silently`: their sockets stay open but send nothing more."""
        for group in self.groups.values():
            group.mute = silently
        if not silently:
            self.groups.clear()

    def _resource(self, session: Session, resource: str, priority: str) -> WatchedResource:
        """A resource by its path, with or without `;facet`. Raises RwsRefused."""
        if priority not in ("0", "1", "2"):
            raise RwsRefused(BAD_ARGUMENT, f"Priority {priority!r}")
        path = "/rw/" + resource.partition(";")[0].strip("/").removeprefix("rw/")
        events = next((one for one in EVENTS if re.fullmatch(one.path, path)), None)
        refused = RwsRefused(BAD_ARGUMENT, f"Invalid resource URI in Create Subscription request {resource}")
        if events is None or (priority == "2" and events.kind not in HIGH_PRIORITY):
            raise refused
        asked = RwsRequest("GET", path, {"order": "lifo"}, {}, {"accept": "v=2.1"}, b"", "")

        def read() -> list[Item]:
            context = RequestContext(self.world, self.version, session, asked, self.world.clock())
            found = []
            for item in answer_request(context).items:
                values = {**item.values, "seqnum": item.title.rpartition("/")[2]}
                title = events.names[0] if "/panel/" in events.path else item.title.removeprefix("RAPID/")
                found.append(Item("", title, {name: values[name] for name in events.names}))
            return found

        try:
            sent = read()
        except RwsRefused:
            raise refused from None
        if events.kind == "ios-signalstate-ev":  # with its device, also when it was named without
            path = f"/rw/iosystem/signals/{sent[0].title}"
        return WatchedResource(events.kind, path + events.facet, int(priority), read, sent)
