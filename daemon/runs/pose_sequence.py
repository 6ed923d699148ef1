"""A tour with the camera: store each station at once, search it for the target while the arm moves on."""

import asyncio
from dataclasses import dataclass

from calibration.problem import Problem, View
from daemon.cell.cell import Cell
from daemon.cell.motion_rules import MotionRules
from daemon.config.settings import TaughtPose
from daemon.errors import TargetNotSeen
from daemon.model.run_states import RunEvent as E
from daemon.runs.run_log import RunLog
from daemon.runs.tour import tour
from daemon.sessions.session_writer import SessionLog
from drivers.interfaces import PoseReading


@dataclass(frozen=True)
class Itinerary:
    """Where a run goes, and by which rules."""

    stations: tuple[TaughtPose, ...]
    rules: MotionRules


async def look_from_everywhere(
    itinerary: Itinerary, cell: Cell, session: SessionLog, log: RunLog, fewest: int
) -> Problem:
    """Every station's picture, stored and searched. Raises TargetNotSeen when fewer than `fewest` show the target."""
    searches: list[asyncio.Task[View]] = []

    async def at_station(reading: PoseReading) -> None:
        index = await session.add(await cell.picture(reading), reading)
        searches.append(asyncio.create_task(session.view(index)))

    try:
        await tour(itinerary.stations, cell, itinerary.rules, log, at_station, last=E.ALL_CAPTURED)
        views = [await search for search in searches]
    finally:
        for search in searches:
            search.cancel()
        await asyncio.gather(*searches, return_exceptions=True)
    require_seen(views, fewest)
    await log.took(E.DETECTED)
    return session.problem(views)


def require_seen(views: list[View], fewest: int) -> None:
    """Raises TargetNotSeen, naming every station that does not show it."""
    missing = [view for view in views if view.detection is None]
    if len(views) - len(missing) >= fewest:
        return
    stations = ", ".join(str(view.index + 1) for view in missing)
    reason = missing[0].missing[1] if missing[0].missing else "it was not found"
    raise TargetNotSeen(
        f"the target was seen from {len(views) - len(missing)} of {len(views)} stations, {fewest} are needed;"
        f" not from station {stations}: {reason}",
        "look at the pictures (GET /runs/{id}/frames/{k}); check target, light, focus and poses",
    )
