"""Everything that can happen at a cell, in one model, and for each invariant a daemon without the safeguard for it."""

import httpx
import pytest

from protocols.plc.codes import ControlBit
from tests.extensions.touch.touches import TIP_MM
from tests.stories.one_model.model import run_histories
from tests.stories.one_model.plant_process import SABOTAGES
from tests.stories.one_model.stored import check_store
from tests.stories.one_model.world import World, a_world
from tests.support.cases import cases
from tests.support.waiting import eventually

pytestmark = pytest.mark.slow


def test_histories_in_any_order() -> None:
    counts = run_histories(cases(5))
    assert counts["departures"] > 0


async def aborted_in_mid_run(world: World) -> None:
    await world.starts("operator", "/calibrate", {}, wait=False)
    await eventually(lambda: world.witness.departures > 0)
    await world.aborts("operator")


async def jogged(world: World) -> None:
    await world.starts("operator", "/robot/jog", {"shift_mm": [0.0, 0.0, 20.0]}, wait=True)
    await world.check_disarmed()


async def jogged_out_of_the_box(world: World) -> None:
    for _ in range(4):
        await world.starts("operator", "/robot/jog", {"shift_mm": [0.0, 0.0, 90.0]}, wait=True)


async def approached_backwards(world: World) -> None:
    await world.applies("operator", 0)
    await world.starts("operator", "/verify", {}, wait=True)
    for direction in ([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]):
        await world.approaches("operator", direction, TIP_MM.tolist(), point=10)


async def asked_by_nobody(world: World) -> None:
    await world.starts("nobody", "/robot/jog", {"shift_mm": [0.0, 0.0, 20.0]}, wait=True)


async def audited(world: World) -> None:
    await jogged(world)
    await check_store(world)


async def scanned(world: World) -> None:
    await world.starts("operator", "/scans", {"capture": False, "name": "part"}, wait=False)
    await check_store(world)


async def applied(world: World) -> None:
    await world.applies("operator", 0)
    await check_store(world)


CONTROLS = {
    "an abort stops nothing": (aborted_in_mid_run, "abort: "),
    "nobody disarms": (jogged, "armed: "),
    "there is no box": (jogged_out_of_the_box, "box: "),
    "an approach is not held against the point": (approached_backwards, "tip: "),
    "roles are not asked": (asked_by_nobody, "consent: departure"),
    "runs are not audited": (audited, "audit: "),
    "scans are forgotten": (scanned, "store: scans"),
    "nothing is applied": (applied, "calibration: "),
}


def test_every_sabotage_has_its_control() -> None:
    assert CONTROLS.keys() == SABOTAGES.keys()


@pytest.mark.parametrize(("sabotage", "control"), CONTROLS.items(), ids=CONTROLS)
async def test_what_a_safeguard_prevents_is_found_without_it_and_not_with_it(
    sabotage: str, control: tuple[object, str]
) -> None:
    story, found = control
    async with a_world() as world:
        await story(world)  # type: ignore[operator]
        assert world.witness.wrong == []
    async with a_world(sabotage) as world:
        await story(world)  # type: ignore[operator]
        assert any(each.startswith(found) for each in world.witness.wrong), world.witness.wrong


async def test_a_plcs_run_is_asked_for_and_another_ones_is_not() -> None:
    async with a_world() as world:
        await world.applies("operator", 0)
        await world.plc_sets(ControlBit.TRIGGER_VERIFY)
        assert world.counts
        assert world.witness.wrong == []
        await world.waits_for_the_end()
        assert world.witness.departures > 0
        world.cell.controller.arm.depart(world.cell.controller.arm.joints_at(0.0), 100.0, False, 1e6)
        assert world.witness.wrong == ["consent: departure 4 was asked for by nobody who may"]


async def test_a_start_that_outlasts_the_daemon_may_have_begun_and_a_refused_one_has_not() -> None:
    async with a_world() as world:
        before = world.sent
        world._take("operator", httpx.Response(503, json={"code": "stopping"}), "/robot/jog")
        assert world.sent == before + 1
        world._take("operator", httpx.Response(409, json={"code": "run-in-progress"}), "/robot/jog")
        world._take("operator", httpx.Response(503, json={"code": "stopping"}), "manual jog", starts=False)
        assert world.sent == before + 1
        assert world.witness.wrong == []
