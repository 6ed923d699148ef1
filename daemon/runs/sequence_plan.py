"""The plan of a run that takes its views along one sequence of poses, into a session of its own."""

from collections.abc import Awaitable, Callable

from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog
from daemon.runs.supervisor import RunPlan, RunResult
from daemon.sessions.session_writer import SessionWriter

MakeSequence = Callable[[SessionWriter, RunLog], PoseSequence]
OpenSession = Callable[[RunLog], SessionWriter]
Drive = Callable[[PoseSequence, RunLog], Awaitable[RunResult]]


def plan_sequence(stations: int, sequence: MakeSequence, session: OpenSession, drive: Drive) -> RunPlan:
    """A run of so many stations, which opens its session when it begins."""

    async def drive_sequence(log: RunLog) -> RunResult:
        return await drive(sequence(session(log), log), log)

    return RunPlan(stations, drive_sequence)
