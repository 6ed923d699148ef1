"""Subscription groups: watched resources, and the changes not yet sent."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mock_robot.rws import documents
from mock_robot.rws.exchange import Item
from mock_robot.rws.refusals import BAD_ARGUMENT, RwsRefused
from mock_robot.rws.sessions import Session
from mock_robot.rws.world import World

MAX_RESOURCES = 1000
MAX_HIGH_PRIORITY = 64
PERIODS_S = {0: 5.0, 1: 0.2, 2: 0.02}
"""Polling period in seconds of low, medium and high priority."""
_PANEL = {
    "panel/ctrlstate": ("pnl-ctrlstate-ev", "ctrlstate"),
    "panel/ctrl-state": ("pnl-ctrlstate-ev", "ctrlstate"),
    "panel/opmode": ("pnl-opmode-ev", "opmode"),
    "panel/speedratio": ("pnl-speedratio-ev", "speedratio"),
}
_CTRLSTATE = {1: "panel/ctrlstate", 2: "panel/ctrl-state"}


@dataclass
class WatchedResource:
    """One resource: `read` returns its current values, `sent` are those last sent to the client."""

    kind: str
    href: str
    priority: int
    read: Callable[[], list[Item]]
    sent: list[Item] = field(default_factory=list)
    due_s: float = 0.0

    def changes(self) -> list[Item]:
        """Items that changed since the last call; new log entries one by one, oldest first."""
        now = self.read()
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
        watched = [self._resource(form[number], form.get(f"{number}-p", "")) for number in numbers]
        if sum(each.priority == 2 for each in watched) > MAX_HIGH_PRIORITY:
            raise RwsRefused(BAD_ARGUMENT, f"More than {MAX_HIGH_PRIORITY} resources of high priority")
        for each in watched:
            each.sent = each.read()
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

    def _resource(self, resource: str, priority: str) -> WatchedResource:
        """A resource by its path, with or without `;facet`. Raises RwsRefused."""
        if priority not in ("0", "1", "2"):
            raise RwsRefused(BAD_ARGUMENT, f"Priority {priority!r}")
        found = self._find(resource.partition(";")[0].strip("/").removeprefix("rw/"))
        if found is None or (priority == "2" and found[0] not in ("ios-signalstate-ev", "rap-data", "rap-value-ev")):
            raise RwsRefused(BAD_ARGUMENT, f"Invalid resource URI in Create Subscription request {resource}")
        kind, href, read = found
        return WatchedResource(kind, href, int(priority), read)

    def _find(self, path: str) -> tuple[str, str, Callable[[], list[Item]]] | None:
        if path in _PANEL and (path.startswith(_CTRLSTATE[self.version]) or "ctrl" not in path):
            kind, name = _PANEL[path]
            return kind, f"/rw/{path}", lambda: [Item("", name, {name: self._panel(name)})]
        if path == "rapid/execution":
            return (
                "rap-ctrlexecstate-ev",
                "/rw/rapid/execution;ctrlexecstate",
                lambda: [Item("", "execution", {"ctrlexecstate": self.world.execution_state})],
            )
        if path.startswith("iosystem/signals/"):
            return self._signal(path.removeprefix("iosystem/signals/"))
        if path == "elog/0":
            world = self.world
            return (
                "elog-message-ev",
                "/rw/elog/0",
                lambda: [Item("", one.title, {"seqnum": one.title.rpartition("/")[2]}) for one in world.elog.items()],
            )
        if path.startswith("rapid/symbol/"):
            return self._symbol(path)
        return None

    def _panel(self, name: str) -> str:
        panel = self.world.cabinet.panel
        values = {
            "ctrlstate": self.world.controller_state,
            "opmode": panel.mode.value,
            "speedratio": str(round(100 * panel.speed_override)),
        }
        return values[name]

    def _signal(self, path: str) -> tuple[str, str, Callable[[], list[Item]]] | None:
        found = self.world.signal(path)
        if found is None:
            return None
        name, title = found[0], f"{found[1].place}/{found[0]}".strip("/")

        def read() -> list[Item]:
            lvalue = self.world.signals[name].lvalue(self.world.cabinet)
            return [Item("", title, {"lvalue": lvalue, "lstate": "not simulated"})]

        return "ios-signalstate-ev", f"/rw/iosystem/signals/{title};state", read

    def _symbol(self, path: str) -> tuple[str, str, Callable[[], list[Item]]] | None:
        """`symbol/data/RAPID/...` in 1.0, `symbol/RAPID/.../data` in 2.0."""
        first = self.version == 1
        bare = path.removeprefix("rapid/symbol/data/RAPID/" if first else "rapid/symbol/RAPID/").removesuffix("/data")
        found = self.world.memory.symbol(bare, self.world.cabinet)
        if found is None:
            return None
        symbol = found[1]
        kind = "rap-data" if first else "rap-value-ev"
        return kind, f"/rw/{path};value", lambda: [Item("", found[0], {"value": symbol.value})]
