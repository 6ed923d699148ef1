"""Stops and disarms the arm until the controller confirms both; also an arm that is armed without a run."""

import asyncio
import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from calibration.sentences.sentence import Sentence
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import Publish
from daemon.runtime.metrics import Metric
from daemon.runtime.tasks import Service, end_task
from drivers.errors import DeviceError
from drivers.interfaces import Robot, Standstill

log = logging.getLogger(__name__)

MAX_ATTEMPT_S = 3.0
"""Limit of one attempt, and of waiting for the confirmation; a controller stops after 2 s of silence by itself."""

POLL_S, RETRY_S, WATCH_S = 0.02, 0.25, 1.0
"""Interval of reading whether the arm stands, pause between attempts, interval of looking for an arm left armed."""

UNKNOWN = Standstill(standing=False, disarmed=False)
UNANSWERED = f"the controller did not confirm it in {MAX_ATTEMPT_S:g} s"


@dataclass(frozen=True)
class StopReport:
    """What the controller has confirmed of a stop, and why not the rest."""

    confirmed: Standstill
    why: str = ""

    @property
    def complete(self) -> bool:
        return self.confirmed.standing and self.confirmed.disarmed

    @property
    def warning(self) -> Sentence:
        """Such as "the arm is not confirmed to be stopped and disarmed: no reply for 2 s"."""
        standing, disarmed = self.confirmed.standing, self.confirmed.disarmed
        missing = "disarmed" if standing else "standing" if disarmed else "both"
        return Sentence(f"stop-unconfirmed-{missing}", why=self.why)


class SafeStop(Service):
    """Stops and disarms `robot`. A stop that was begun is repeated until it is confirmed, whoever waits for it.

    `is_leased`: whether a run may have the arm armed now. Each change of what is confirmed is published as event `arm`.
    """

    def __init__(self, robot: Robot, clock: Clock, is_leased: Callable[[], bool], publish: Publish) -> None:
        self._robot, self._clock, self._is_leased, self._publish = robot, clock, is_leased, publish
        self._stopping: asyncio.Task[None] | None = None
        self._watching: asyncio.Task[None] | None = None
        self._unconfirmed: StopReport | None = None
        self._pending = False
        self._begun_s = 0.0

    @property
    def unconfirmed(self) -> StopReport | None:
        """What is known of a stop that is not confirmed yet; None when there is none."""
        return (self._unconfirmed or StopReport(UNKNOWN, "it is being stopped")) if self._pending else None

    async def start(self) -> None:
        """Begin to watch for an arm that is armed without a lease."""
        if self._robot.capabilities.moves:
            self._watching = asyncio.create_task(self._watch(), name="looks for an arm left armed")

    async def stop(self) -> None:
        """End the watch and the attempts."""
        for task in (self._watching, self._stopping):
            await end_task(task)

    def begin(self) -> None:
        """Send stop and disarm now, unless an attempt is in progress."""
        self._pending = True
        if self._stopping is None or self._stopping.done():
            self._begun_s = self._clock.monotonic_s()
            self._stopping = asyncio.create_task(self._repeat_until_confirmed(), name="stops and disarms the arm")

    async def stop_and_disarm(self) -> StopReport | None:
        """Stop and disarm; None when both are confirmed, otherwise what is known MAX_ATTEMPT_S after the stop began."""
        self.begin()
        assert self._stopping is not None
        left_s = self._begun_s + MAX_ATTEMPT_S - self._clock.monotonic_s()
        await asyncio.wait([self._stopping], timeout=max(left_s, 0.0))
        return self.unconfirmed

    def warnings(self) -> list[str]:
        """What is not confirmed, for GET /ready."""
        return [self._unconfirmed.warning] if self._unconfirmed else []

    def families(self) -> Iterator[Metric]:
        yield Metric("handeyed_arm_stop_unconfirmed", "gauge",
                     "1 while the controller has not confirmed that the arm is stopped and disarmed.",
                     {(): float(self._unconfirmed is not None)})  # fmt: skip

    async def _repeat_until_confirmed(self) -> None:
        while not (report := await self._attempt()).complete:
            self._note(report)
            await self._clock.sleep(RETRY_S)
            while report.confirmed.standing and not self._robot.link.connected:
                await self._clock.sleep(RETRY_S)  # it stands; whether it is disarmed is seen over the link only
        self._pending = False
        self._note(report)

    async def _attempt(self) -> StopReport:
        confirmed, why = UNKNOWN, ""
        try:
            async with asyncio.timeout(MAX_ATTEMPT_S):
                try:
                    await self._robot.stop_and_disarm()
                except DeviceError as error:
                    why = str(error)
                while not (confirmed := await self._robot.read_standstill()).disarmed or not confirmed.standing:
                    if why or confirmed.standing:
                        break
                    await self._clock.sleep(POLL_S)
        except DeviceError as error:
            why = why or str(error)
        except TimeoutError:
            why = why or UNANSWERED
        except Exception as error:
            log.exception("a defect kept the arm from being stopped and disarmed; it is tried again")
            why = f"{type(error).__name__}: {error}"
        return StopReport(confirmed, why or "the controller reports it armed")

    def _note(self, report: StopReport) -> None:
        """Log and publish what has changed."""
        before, self._unconfirmed = self._unconfirmed, None if report.complete else report
        if (before or StopReport(Standstill(True, True))).confirmed == report.confirmed:
            return
        if report.complete:
            log.warning("the controller now confirms that the arm is stopped and disarmed")
        else:
            log.error("%s", report.warning)
        self._publish("arm", {
            "stopped": report.confirmed.standing, "disarmed": report.confirmed.disarmed,
            "why": "" if report.complete else report.why, "at": self._clock.timestamp(),
        })  # fmt: skip

    async def _watch(self) -> None:
        while True:
            await self._clock.sleep(WATCH_S)
            if self._pending or self._is_leased() or not self._robot.link.connected:
                continue
            with suppress(DeviceError, TimeoutError):
                async with asyncio.timeout(MAX_ATTEMPT_S):
                    found = await self._robot.read_standstill()
                if not (found.disarmed or self._pending or self._is_leased()):
                    self._note(StopReport(found, "it was armed without a run"))
                    self.begin()
