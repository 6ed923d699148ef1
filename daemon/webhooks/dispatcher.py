"""Messages go out in their order, each until it is taken; a receiver that does not answer is asked ever more rarely."""

import asyncio
import json
import logging
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from daemon.config.server_settings import WebhookSettings
from daemon.errors import StorageError
from daemon.runtime.clock import Clock
from daemon.runtime.metrics import Labels, Metric
from daemon.store.outbox import Message, Outbox
from daemon.webhooks.signing import secrets_in, signed_headers

log = logging.getLogger(__name__)

ANSWER_LIMIT_S = 10.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 300.0
LOOK_S = 5.0
"""The outbox is looked into at least so often; usually it is told of news."""

NEVER_TAKEN = frozenset({400, 406, 411, 413, 415, 422, 431})
"""Answers that will not change: after some more tries the message is left out, or nothing behind it would arrive."""

TRIES_OF_NEVER_TAKEN = 8

FAILURES_WORTH_A_WARNING = 3


def pause_s(failures: int, chance: float) -> float:
    """Doubles with each failure up to the longest; `chance` in 0..1 spreads receivers that failed together."""
    return float(min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2 ** min(failures - 1, 20)) * (0.5 + 0.5 * chance))


@dataclass(eq=False)
class Dispatcher:
    """One task a receiver."""

    webhooks: tuple[WebhookSettings, ...]
    outbox: Outbox
    clock: Clock
    chance: Callable[[], float]
    failures: Counter[str] = field(default_factory=Counter)
    """Of each receiver, since it last took something."""

    _tasks: list[asyncio.Task[None]] = field(default_factory=list, init=False)

    async def start(self) -> None:
        """Raises SecretUnusable, StorageError."""
        secrets = [secrets_in(Path(webhook.secret_file)) for webhook in self.webhooks]
        for webhook in self.webhooks:
            await self.outbox.subscribe(webhook.receiver)
        for webhook, keys in zip(self.webhooks, secrets, strict=True):
            self._tasks.append(asyncio.create_task(self._serve(webhook, keys)))

    async def stop(self) -> None:
        """What was not taken is sent by the next daemon."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def warnings(self) -> list[str]:
        """Receivers that take nothing."""
        return [
            f"webhook {name} has not taken anything at the last {count} attempts: look at its server and the log"
            for name, count in self.failures.items()
            if count >= FAILURES_WORTH_A_WARNING
        ]

    def families(self) -> Iterable[Metric]:
        failures: dict[Labels, float] = {
            (("receiver", webhook.receiver),): float(self.failures[webhook.receiver]) for webhook in self.webhooks
        }
        about = "Attempts since a receiver last took something."
        return [Metric("handeyed_webhook_failures", "gauge", about, failures)]

    async def _serve(self, webhook: WebhookSettings, secrets: tuple[bytes, ...]) -> None:
        limits = httpx.Timeout(ANSWER_LIMIT_S)
        async with httpx.AsyncClient(timeout=limits, trust_env=False, follow_redirects=False) as client:
            while True:
                try:
                    await self._next(webhook, secrets, client)
                except StorageError as error:
                    log.warning("webhook %s: the outbox cannot be read: %s", webhook.receiver, error)
                    await self.clock.sleep(LOOK_S)

    async def _next(self, webhook: WebhookSettings, secrets: tuple[bytes, ...], client: httpx.AsyncClient) -> None:
        """Deliver one message, or wait for one."""
        name, bell = webhook.receiver, self.outbox.bell
        message = await self.outbox.next(name)
        if message is None:
            with suppress(TimeoutError):
                await asyncio.wait_for(bell.wait(), LOOK_S)
            return
        if webhook.topics and message.topic not in webhook.topics:
            await self.outbox.delivered(name, message.number)
            return
        refused = await self._sent(webhook, message, secrets, client)
        if refused is None:
            self.failures[name] = 0
            await self.outbox.delivered(name, message.number)
            return
        self.failures[name] += 1
        if refused in NEVER_TAKEN and self.failures[name] >= TRIES_OF_NEVER_TAKEN:
            log.error("webhook %s never takes message %s (HTTP %d): it is left out", name, message.id, refused)
            self.failures[name] = 0
            await self.outbox.delivered(name, message.number)
            return
        await self.clock.sleep(pause_s(self.failures[name], self.chance()))

    async def _sent(
        self, webhook: WebhookSettings, message: Message, secrets: tuple[bytes, ...], client: httpx.AsyncClient
    ) -> int | None:
        """None when it was taken (2xx), else the status; 0 for none at all."""
        body = body_of(message)
        headers = signed_headers(message.id, int(self.clock.utc_now().timestamp()), body, secrets)
        try:
            async with (
                asyncio.timeout(2 * ANSWER_LIMIT_S),
                client.stream("POST", webhook.url, content=body, headers=headers) as answer,
            ):
                status = answer.status_code  # what else it says is nothing to us
        except (httpx.HTTPError, httpx.InvalidURL, TimeoutError) as error:
            status, why = 0, str(error) or type(error).__name__
        else:
            why = f"HTTP {status}"
        if 200 <= status < 300:
            return None
        if self.failures[webhook.receiver] == 0:
            log.warning("webhook %s does not take message %s: %s", webhook.receiver, message.id, why)
        return status


def body_of(message: Message) -> bytes:
    """The same at every attempt."""
    document = {"id": message.id, "type": message.topic, "timestamp": message.at, "data": message.data}
    return json.dumps(document, separators=(",", ":"), sort_keys=True).encode()
