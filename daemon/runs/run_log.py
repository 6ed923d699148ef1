"""Record of the run in progress: applies the state machine, saves the row, publishes events."""

import logging
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any

from calibration.documents.numbers import significant
from daemon.errors import StorageError
from daemon.model.records import CauseDocument, Planning, RunRecord
from daemon.model.run_states import RunState, require_step
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus

RunResult = dict[str, Any]
"""Of a run that has finished; its keys depend on the kind."""

log = logging.getLogger(__name__)

SaveRun = Callable[[RunRecord], Awaitable[None]]


class RunLog:
    """The only place where a run's record changes."""

    def __init__(self, run: RunRecord, save: SaveRun, events: EventBus, clock: Clock) -> None:
        self.run = run
        self.concluding = False
        self.unsaved = False
        self.missed: dict[str, list[str]] = {}
        """Why a sensor beside the camera failed to look, each time, by its name."""
        self.since_s = clock.monotonic_s()
        self.at_each_step: Callable[[], None] = lambda: None
        self._save, self._events, self._clock = save, events, clock
        self._began_s = clock.monotonic_s()

    @property
    def id(self) -> str:
        return self.run.id

    def timestamp(self) -> str:
        """The time now, as the run's record has it."""
        return self._clock.timestamp()

    async def begin(self) -> None:
        """Save the first row. Raises StorageError, and then the run has not begun."""
        await self._save(self.run)
        self._publish()

    async def advance(
        self, state: RunState, *, planning: Planning | None = None, stations: int | None = None, captured: bool = False
    ) -> None:
        """The next state, with the plan and the number of stations if they change. Raises StorageError.

        `captured`: this step ends a station.
        """
        after = self._in(state)
        self.run = replace(
            after,
            planning=planning or after.planning,
            stations=after.stations if stations is None else stations,
            station=after.station + captured,
        )
        await self._save(self.run)
        self._publish()

    async def finish(self, result: RunResult) -> None:
        """End the run, which has taken all its stations, with its result."""
        await self._end(replace(self._in(RunState.FINISHED), result=result, station=self.run.stations))

    async def fail(self, cause: CauseDocument, *, aborted: bool = False) -> None:
        """End the run before it has finished."""
        await self._end(replace(self._in(RunState.ABORTED if aborted else RunState.FAILED), cause=cause))

    async def _end(self, run: RunRecord) -> None:
        """If it cannot be saved, the record stays in memory (`unsaved`) and an error is logged."""
        self.run = run
        try:
            await self._save(self.run)
        except StorageError as error:
            self.unsaved = True
            log.error("the end of the run could not be stored: %s", error)
        self._publish()

    def conclude(self) -> None:
        """From here on the run cannot be aborted."""
        self.concluding = True
        self.at_each_step()

    @property
    def waits_for_operator(self) -> bool:
        """True in the state WAITING, which has a time limit of its own."""
        return self.run.state is RunState.WAITING

    def silent_s(self) -> float:
        """Seconds since the last step; 0 while the run waits for an operator or is over."""
        return 0.0 if self.run.is_over or self.waits_for_operator else self._clock.monotonic_s() - self.since_s

    def _in(self, state: RunState) -> RunRecord:
        require_step(self.run.state, state)
        return replace(self.run, state=state, updated_at=self._clock.timestamp())

    def _publish(self) -> None:
        run = self.run
        self.since_s = self._clock.monotonic_s()
        self.at_each_step()
        self._events.publish("run", run_event(run, self._clock.monotonic_s() - self._began_s))
        ending = f": {run.cause.what}" if run.cause else ""
        if run.state is RunState.MOVING and (words := prediction_text(run.planning)):
            ending = f", {words}"
        log.info("%s %s, station %d of %d%s", run.kind, run.state, run.station, run.stations, ending)


def prediction_text(planning: Planning | None) -> str | None:
    """Such as "predicted U 0.31 -> 0.22 mm", k = 2 at the worst of the points that matter: now, and as planned."""
    if planning is None or (planning.now_mm is None and planning.planned_mm is None):
        return None
    now = "not yet determined" if planning.now_mm is None else f"{significant(planning.now_mm)} mm"
    if planning.planned_mm is None:
        return f"predicted U {now}"
    return f"predicted U {now.removesuffix(' mm')} -> {significant(planning.planned_mm)} mm"


def run_event(run: RunRecord, seconds: float | None = None) -> dict[str, Any]:
    """The data of an event `run`. `seconds`: since the run began, None of one that another process began."""
    planning = run.planning or Planning()
    return {
        "id": run.id,
        "kind": run.kind,
        "state": run.state,
        "station": run.station,
        "stations": run.stations,
        "cause": run.cause.what if run.cause else None,
        "at": run.updated_at,
        "predicted": prediction_text(run.planning),
        "advice": planning.advice,
        "now_mm": planning.now_mm,
        "planned_mm": planning.planned_mm,
        "ahead": planning.ahead,
        "code": run.cause.code if run.cause else None,
        "fix": run.cause.fix if run.cause else None,
        "details": {part: made.model_dump() for part, made in run.cause.details.items()} if run.cause else None,
        "started_by": run.started_by,
        "seconds": None if seconds is None else round(seconds, 3),
        "not_applied": (run.result or {}).get("not_applied"),
    }
