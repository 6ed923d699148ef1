"""What the daemon has stored, against what it has acknowledged and what was asked for."""

from tests.stories.one_model.plant_process import CAMERA_LOST
from tests.stories.one_model.world import World


async def check_store(world: World) -> None:
    """What was acknowledged is there, nothing more than was asked for, one active calibration, the log whole."""
    await _check_runs(world)
    listed = {scan["id"] for scan in (await world.read("/scans?limit=500"))["scans"]}
    if lost := world.scans - listed:
        world.witness.wrong.append(f"store: scans {lost} are gone")
    await _check_in_force(world)
    if not (verified := await world.read("/audit/verified"))["whole"]:
        world.witness.wrong.append(f"audit: {verified['flaws']}")
    rows = (await world.read("/audit?limit=500"))["rows"]
    found = {(row["action"], row["subject"], row["actor"]) for row in rows}
    if missing := world.audited - found:
        world.witness.wrong.append(f"audit: no rows of {missing}")


async def _check_runs(world: World) -> None:
    there = (await world.read("/runs?limit=500"))["runs"]
    for run in there:
        known = world.runs.get(run["id"])
        if known is not None and known["over"] and known["state"] != run["state"]:
            world.witness.wrong.append(f"store: run {run['id']} was {known['state']} and is {run['state']}")
    if lost := set(world.runs) - {run["id"] for run in there}:
        world.witness.wrong.append(f"store: runs {lost} are gone")
    open_runs = [run["id"] for run in there if not run["over"]]
    if len(open_runs) > 1 or (open_runs and open_runs != [world.witness.run]):
        world.witness.wrong.append(f"consent: runs {open_runs} are in progress, {world.witness.run!r} was asked for")
    if len(there) > world.sent:
        world.witness.wrong.append(f"store: {len(there)} runs of {world.sent} requests")


async def _check_in_force(world: World) -> None:
    answer = await world.asks("viewer", "GET", "/calibrations/current")
    assert answer is not None
    current = "" if answer.status_code == 404 else answer.json()["calibration"]["id"]
    if current not in world.in_force:
        world.witness.wrong.append(f"calibration: {current!r} is active, {world.in_force} was applied")
    world.in_force = {current}


async def check_all(world: World) -> list[str]:
    """At the end of a history: undisturbed again, nothing in progress."""
    world.recovers()
    world.cell.clear_faults()
    (world.folder / CAMERA_LOST).unlink(missing_ok=True)
    if world.witness.run:
        await world.aborts("operator")
    await check_store(world)
    await world.check_disarmed()
    return world.witness.wrong
