"""One model of everything that can happen at a cell: hypothesis chooses the order, the world says what must hold."""

import asyncio
import signal
from collections import Counter
from collections.abc import Callable, Coroutine
from contextlib import AsyncExitStack
from typing import Any, ClassVar

from hypothesis import HealthCheck, Phase, settings
from hypothesis import seed as with_seed
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from protocols.plc.codes import ControlBit
from tests.extensions.touch.touches import TIP_MM
from tests.stories.one_model.stored import check_all, check_store
from tests.stories.one_model.world import MAY, World, a_world
from tests.support.patience import PatientLoop

STEPS = 14
"""Of one history, at most."""

people = st.sampled_from((*MAY, *MAY, "viewer", "nobody", "wrong"))
"""Those who may more often than the others."""
shifts_mm = st.tuples(*[st.sampled_from((-90.0, -20.0, 0.0, 20.0, 90.0))] * 3)
small_moves = st.one_of(
    shifts_mm.filter(lambda shift: 0 < sum(x * x for x in shift) <= 1e4).map(lambda shift: {"shift_mm": list(shift)}),
    st.builds(
        lambda axis, deg: {"axis": axis, "by_deg": deg}, st.integers(1, 6), st.sampled_from((-25.0, -5.0, 5.0, 25.0))
    ),
    st.just({"shift_mm": [0.0, 0.0, 20.0], "speed_mm_s": 300}),
)
tips = st.sampled_from(
    (TIP_MM.tolist(), TIP_MM.tolist(), TIP_MM.tolist(), (TIP_MM / 1000).tolist(), [0.0, 0.0, -190.0])
)
directions = st.sampled_from((None, [0.0, 0.0, -1.0], [0.3, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
ways = st.sampled_from(({}, {}, {"stand_off_mm": 60.0}, {"step_mm": 5.0}, {"step_mm": 2.0}))


UP = {"shift_mm": [0.0, 0.0, 20.0]}
AMID: dict[str, Callable[[World], Coroutine[Any, Any, None]]] = {
    "a jog": lambda world: world.starts("operator", "/robot/jog", UP, wait=True),
    "a jog by hand": lambda world: world.manual_step("operator", "jog", UP),
    "a run": lambda world: world.starts("operator", "/calibrate", {}, wait=True),
    "a scan": lambda world: world.starts("operator", "/scans", {"capture": True, "name": "part"}, wait=False),
    "an approach": lambda world: world.approaches("operator", [0.0, 0.0, -1.0], TIP_MM.tolist(), point=10),
}
"""Requests of which one is on its way when the daemon ends."""


class CellModel(RuleBasedStateMachine):
    """`counts`: what was done in all histories of this process; `departures`: of the arm."""

    counts: ClassVar[Counter[str]] = Counter()

    def __init__(self) -> None:
        super().__init__()
        self._runner, self._open = asyncio.Runner(loop_factory=PatientLoop), AsyncExitStack()
        self.world: World = self._do(self._open.enter_async_context(a_world()))

    def _do(self, step: Coroutine[Any, Any, Any]) -> Any:
        return self._runner.run(step)

    @initialize()
    def somebody_works(self) -> None:
        """So that most histories have a run, an active calibration and points that were seen."""
        self._do(self.world.applies("operator", 0))
        self._do(self.world.starts("operator", "/verify", {}, wait=True))

    @rule(who=people, path=st.sampled_from(("/calibrate", "/verify")), wait=st.booleans())
    def calibrates_or_verifies(self, who: str, path: str, wait: bool) -> None:
        self._do(self.world.starts(who, path, {}, wait))

    @rule(who=people, capture=st.booleans())
    def scans(self, who: str, capture: bool) -> None:
        self._do(self.world.starts(who, "/scans", {"capture": capture, "name": "part"}, wait=False))

    @rule(who=people, jog=small_moves)
    def jogs(self, who: str, jog: dict[str, Any]) -> None:
        self._do(self.world.starts(who, "/robot/jog", jog, wait=True))

    @rule(who=people)
    def begins_by_hand(self, who: str) -> None:
        self._do(self.world.starts(who, "/calibrate", {"manual": True}, wait=False))

    @precondition(lambda self: self.world.manual)
    @rule(who=people, step=st.sampled_from(("stations", "stations", "finish")))
    def goes_on_by_hand(self, who: str, step: str) -> None:
        self._do(self.world.manual_step(who, step, None))

    @precondition(lambda self: self.world.manual)
    @rule(who=people, jog=small_moves)
    def jogs_by_hand(self, who: str, jog: dict[str, Any]) -> None:
        self._do(self.world.manual_step(who, "jog", jog))

    @rule(who=people, direction=directions, tip=tips, way=ways, point=st.sampled_from((0, 10, 40)))
    def approaches(self, who: str, direction: Any, tip: list[float], way: dict[str, float], point: int) -> None:
        self._do(self.world.approaches(who, direction, tip, point=point, **way))

    @rule(who=people, index=st.integers(0, 20))
    def applies_or_rolls_back(self, who: str, index: int) -> None:
        self._do(self.world.applies(who, index))

    @rule(who=people)
    def aborts(self, who: str) -> None:
        self._do(self.world.aborts(who))

    @rule(number=st.integers(0, 10**9))
    def keys_change(self, number: int) -> None:
        self._do(self.world.keys_change(f"key {number} of {self.world.sent} {len(self.world.keys)}"))

    @rule(
        bits=st.sampled_from(
            (ControlBit.TRIGGER_CALIBRATE, ControlBit.TRIGGER_VERIFY, ControlBit.ABORT, ControlBit.RESULTS_ACK)
        )
    )
    def plc_acts(self, bits: ControlBit) -> None:
        self._do(self.world.plc_sets(bits))

    @rule(how=st.sampled_from((signal.SIGKILL, signal.SIGTERM)), amid=st.sampled_from((None, *AMID)))
    def daemon_ends_and_starts(self, how: signal.Signals, amid: str | None) -> None:
        self._do(self._end_amid(how, amid))

    async def _end_amid(self, how: signal.Signals, amid: str | None) -> None:
        world = self.world
        if amid is None:
            await world.end(how)
        else:
            if amid == "a jog by hand":
                await world.starts("operator", "/calibrate", {"manual": True}, wait=False)
            asked = asyncio.create_task(AMID[amid](world))
            await world.waits_for_a_departure()
            await world.end(how)
            await asked
            world.witness.run, world.manual = "", False
        await world.start()
        await check_store(world)

    @rule(fault=st.sampled_from(("link-reset", "link-reply-lost", "link-restart")))
    def link_or_controller_fails(self, fault: str) -> None:
        self._do(self.world.link_fault(fault))

    @rule(lasts=st.booleans())
    def emergency_stop(self, lasts: bool) -> None:
        self._do(self.world.emergency_stop(lasts))

    @rule(lasts=st.booleans())
    def camera_is_lost_or_found(self, lasts: bool) -> None:
        self._do(self.world.camera_is_lost(lasts))

    @rule(by_h=st.sampled_from((-30.0, -1.0, 1.0, 9.0)))
    def clock_jumps(self, by_h: float) -> None:
        self._do(self.world.clock_jumps(3600.0 * by_h))

    @rule()
    def waits(self) -> None:
        self._do(self.world.waits_for_a_departure())

    @rule()
    def waits_for_the_end(self) -> None:
        self._do(self.world.waits_for_the_end())

    @invariant()
    def nothing_is_wrong(self) -> None:
        self._do(self.world.check_disarmed())
        assert self.world.witness.wrong == [], self.world.witness.wrong  # no pytest shows it in make torture

    def teardown(self) -> None:
        try:
            wrong = self._do(check_all(self.world))
            CellModel.counts.update(self.world.counts, departures=self.world.witness.departures, histories=1)
            CellModel.counts.update(runs=len(self.world.runs))
            assert wrong == [], wrong
        finally:
            self._do(self._open.aclose())
            self._runner.close()


def run_histories(count: int, seed: int | None = None) -> Counter[str]:
    """What was done in so many histories. Raises AssertionError with the shortest one in which something was wrong."""
    CellModel.counts.clear()
    chosen = settings(
        max_examples=count, stateful_step_count=STEPS, deadline=None, database=None, print_blob=False,
        suppress_health_check=list(HealthCheck), phases=(Phase.generate, Phase.shrink),
    )  # fmt: skip
    machine = CellModel
    if seed is not None:
        machine = with_seed(seed)(machine)
    run_state_machine_as_test(machine, settings=chosen)
    return Counter(CellModel.counts)
