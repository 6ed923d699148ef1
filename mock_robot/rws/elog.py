"""The cabinet's event log as RWS lists it: numbered, newest first, with names for types and arguments."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from mock_robot.cabinet.cabinet import Cabinet, LogEntry
from mock_robot.rapid.statements import HANDLED_ERROR
from mock_robot.rws.exchange import Item

INFORMATION, WARNING, ERROR = 1, 2, 3
_TYPES: tuple[tuple[range, int], ...] = (
    (range(10000, 20000), INFORMATION),
    (range(HANDLED_ERROR, HANDLED_ERROR + 1), WARNING),
    (range(20000, 80000), ERROR),
    (range(80001, 80002), ERROR),
    (range(80002, 80003), WARNING),
    (range(80003, 80004), INFORMATION),
)
USER_EVENTS = range(80001, 80004)
"""Codes of ErrWrite: their texts have several lines, the first is the header."""
PAGE = 50


@dataclass(frozen=True)
class ControllerEventLog:
    """The event log of `GET /rw/elog/0`. `epoch` is the wall clock at zero of the cell's clock."""

    cabinet: Cabinet
    epoch: datetime

    @classmethod
    def starting_at(cls, cabinet: Cabinet, now_s: float) -> "ControllerEventLog":
        """Event log whose epoch follows from the current wall clock."""
        return cls(cabinet, datetime.now(UTC) - timedelta(seconds=now_s))

    @property
    def newest(self) -> int:
        """Number of the newest entry; 0 when there is none."""
        return self.cabinet.recorded

    def items(self, above: int = 0, *, oldest_first: bool = False) -> list[Item]:
        """One page of the entries with numbers above `above`, from the newest or from the oldest on."""
        log, newest = self.cabinet.log, self.newest
        numbered = [(newest - back, entry) for back, entry in enumerate(reversed(log))]
        page = (numbered[::-1] if oldest_first else numbered)[:PAGE]
        return [self._item(number, entry) for number, entry in page if number > above]

    def _item(self, number: int, entry: LogEntry) -> Item:
        at = self.epoch + timedelta(seconds=entry.at_s)
        lines = entry.text.split("\n") if entry.code in USER_EVENTS else []
        kind = next((kind for codes, kind in _TYPES if entry.code in codes), WARNING)
        values = {
            "msgtype": str(kind),
            "code": str(entry.code),
            "src-name": "MC0",
            "tstamp": f"{at:%Y-%m-%d T %H:%M:%S}",
            "title": entry.text.split("\n")[0],
            "desc": entry.text.replace("\n", " "),
            "conseqs": "",
            "causes": "",
            "actions": "",
            "argc": str(len(lines)),
        }
        arguments = {"argv": [{"type": "STRING", "value": line} for line in lines]} if lines else {}
        return Item("elog-message-li", f"/rw/elog/0/{number}", {**values, **arguments})
