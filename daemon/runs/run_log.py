"""A run tells what happens to it: the state table is followed, the row saved, listeners told."""

import logging
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any

from daemon.errors import StorageError
from daemon.model.records import Cause, Planning, RunRecord
from daemon.model.run_states import RunEvent, RunState, next_state
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus

log = logging.getLogger(__name__)

SaveRun = Callable[[RunRecord], Awaitable[None]]

STATION_DONE = frozenset({RunEvent.CAPTURED, RunEvent.ALL_CAPTURED, RunEvent.ALL_STORED})


def ignore_step() -> None:
    """Nobody counts the steps."""


class RunLog:
    """The one place where a run's record changes."""

    def __init__(self, run: RunRecord, save: SaveRun, events: EventBus, clock: Clock) -> None:
        self.run = run
        self.concluding = False
        self.unsaved = False
        self.since_s = clock.monotonic_s()
        self.at_each_step: Callable[[], None] = ignore_step
        self._save, self._events, self._clock = save, events, clock

    @property
    def id(self) -> str:
        return self.run.id

    async def begin(self) -> None:
        """The first row. Raises StorageError; the run has then not begun."""
        await self._save(self.run)
        self._publish()

    async def advance(
        self, event: RunEvent, *, planning: Planning | None = None, stations: int | None = None, captured: bool = False
    ) -> None:
        """The run goes on, with what it plans and how many stations it foresees. Raises StorageError.

        `captured`: the event ends a station, though it does not always.
        """
        after = self._after(event)
        self.run = replace(
            after,
            planning=planning or after.planning,
            stations=after.stations if stations is None else stations,
            station=after.station + captured,
        )
        await self._save(self.run)
        self._publish()

    async def end(self, event: RunEvent, *, cause: Cause | None = None, result: dict[str, Any] | None = None) -> None:
        """The run is over. A disk that cannot take it leaves the record in memory, and the operator is told."""
        self.run = replace(self._after(event), cause=cause, result=result)
        try:
            await self._save(self.run)
        except StorageError as error:
            self.unsaved = True
            log.error("the end of the run could not be stored: %s", error)
        self._publish()

    def conclude(self) -> None:
        """From here on the run cannot be aborted: what follows is done whole."""
        self.concluding = True
        self.at_each_step()

    @property
    def waits_for_operator(self) -> bool:
        """An operator may take as long as the run's own limit allows."""
        return self.run.state is RunState.WAITING

    def silent_s(self) -> float:
        """How long it has been at the same step, unless that waits for an operator."""
        return 0.0 if self.run.over or self.waits_for_operator else self._clock.monotonic_s() - self.since_s

    def _after(self, event: RunEvent) -> RunRecord:
        return replace(
            self.run,
            state=next_state(self.run.state, event),
            station=self.run.station + (event in STATION_DONE),
            updated_at=self._clock.timestamp(),
        )

    def _publish(self) -> None:
        run = self.run
        self.since_s = self._clock.monotonic_s()
        self.at_each_step()
        self._events.publish("run", run_event(run))
        ending = f": {run.cause.what}" if run.cause else ""
        if run.state is RunState.MOVING and (words := prediction_text(run.planning)):
            ending = f", {words}"
        log.info("%s %s, station %d of %d%s", run.kind, run.state, run.station, run.stations, ending)


def prediction_text(planning: Planning | None) -> str | None:
    """predicted 0.31 -> 0.22 mm: what the views so far tell of a mapped point, and what those planned next will."""
    if planning is None or (planning.now_mm is None and planning.planned_mm is None):
        return None
    now = "not yet determined" if planning.now_mm is None else f"{planning.now_mm:.2g}"
    return f"predicted {now} mm" if planning.planned_mm is None else f"predicted {now} -> {planning.planned_mm:.2g} mm"


def run_event(run: RunRecord) -> dict[str, Any]:
    """Where a run stands, as listeners are told."""
    return {
        "id": run.id,
        "kind": run.kind,
        "state": run.state,
        "station": run.station,
        "stations": run.stations,
        "cause": run.cause.what if run.cause else None,
        "at": run.updated_at,
        "predicted": prediction_text(run.planning),
        "advice": run.planning.advice if run.planning else "",
    }
