"""Records as a store holds them."""

from pathlib import Path

from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from daemon.store.database import DATABASE_NAME

AT = "2026-11-21T09:00:00.000Z"


def a_run(run_id: str, state: RunState = RunState.MOVING) -> RunRecord:
    return RunRecord(run_id, "calibration", state, 1, 3, AT, AT, request={"count": 3})


def names_in(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir() if not file.name.startswith(DATABASE_NAME))
