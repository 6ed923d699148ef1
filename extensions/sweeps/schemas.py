"""Schemas of sweeps."""

from typing import Literal

from daemon.api.problems import problem_of
from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, example
from extensions.sweeps.recorder import Sweep


class SweepProblem(Answer):
    """Why a sweep has failed."""

    code: str
    detail: str


class SweepDocument(Answer):
    """A sweep of a line profiler. `points`: in base so far, at links.points.

    `left_out_profiles`: taken before the first pose or after the end. `lost_profiles`: counted by the sensor, and not
    sent. `largest_gap_s`: between two poses of the path.
    """

    model_config = example(
        id=EXAMPLE_ID, created_at=EXAMPLE_AT, scanner="scanner", calibration_id=EXAMPLE_ID, state="running",
        profiles=4000, points=5_120_000, poses=500, lost_profiles=0, left_out_profiles=12, largest_gap_s=0.004,
        problem=None, links={"self": f"/sweeps/{EXAMPLE_ID}", "points": f"/sweeps/{EXAMPLE_ID}/points"},
    )  # fmt: skip

    id: str
    created_at: str
    scanner: str
    calibration_id: str
    state: Literal["running", "done", "failed"]
    profiles: int
    points: int
    poses: int
    lost_profiles: int
    left_out_profiles: int
    largest_gap_s: float
    problem: SweepProblem | None
    links: dict[str, str]

    @classmethod
    def of(cls, sweep: Sweep) -> "SweepDocument":
        here, failure = f"/sweeps/{sweep.id}", sweep.failure
        found = None if failure is None else problem_of(failure)
        return cls(
            id=sweep.id, created_at=sweep.created_at, scanner=sweep.scanner, calibration_id=sweep.calibration_id,
            state=sweep.state, profiles=sweep.profiles, points=sweep.points, poses=sweep.poses,
            lost_profiles=sweep.lost_profiles, left_out_profiles=sweep.left_out_profiles,
            largest_gap_s=sweep.largest_gap_s,
            problem=None if found is None else SweepProblem(code=found.code, detail=found.detail),
            links={"self": here, "points": f"{here}/points", "end": f"{here}/end"},
        )  # fmt: skip
