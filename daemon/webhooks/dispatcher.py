"""Delivers the outbox to each webhook in order; repeats a failed message with exponential backoff from 1 s to 300 s."""

import asyncio
import base64
import hashlib
import hmac
import json
import logging
import ssl
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from calibration.sentences.sentence import Sentence
from daemon.access.tls_context import trusting
from daemon.config.server_settings import WebhookSettings
from daemon.errors import DaemonError, StorageError
from daemon.runtime.clock import Clock
from daemon.runtime.metrics import Labels, Metric
from daemon.runtime.tasks import SectionService
from daemon.store.outbox import Outbox, OutboxMessage
from registration.io.regular_file import read_regular

Trusted = ssl.SSLContext | bool
"""Whose certificates count; True: those of the public authorities."""

MIN_SECRET_BYTES = 32
"""The length of the hash: a longer secret is no stronger, a shorter one is weaker."""

MAX_FILE_BYTES = 1 << 16


def signature_headers(message_id: str, at_s: int, body: bytes, secrets: Sequence[bytes]) -> dict[str, str]:
    """The headers for a body, with one signature per secret, so that secrets can be rotated without interruption."""
    signatures = (f"v1,{signature(message_id, at_s, body, secret)}" for secret in secrets)
    return {
        "webhook-id": message_id,
        "webhook-timestamp": str(at_s),
        "webhook-signature": " ".join(signatures),
        "content-type": "application/json",
    }


def signature(message_id: str, at_s: int, body: bytes, secret: bytes) -> str:
    """Base64 of HMAC-SHA256(secret, "id.timestamp.body")."""
    content = f"{message_id}.{at_s}.".encode() + body
    return base64.b64encode(hmac.new(secret, content, hashlib.sha256).digest()).decode()


def read_secrets(file: Path) -> tuple[bytes, ...]:
    """The secrets of a file, one per line: text, or base64 after "whsec_". Raises SecretUnusable."""
    try:
        lines = [line.strip() for line in read_regular(file, MAX_FILE_BYTES).splitlines() if line.strip()]
    except OSError as error:
        raise SecretUnusable(file, (error.strerror or str(error)).lower()) from None
    secrets = tuple(_secret(line, file) for line in lines)
    if not secrets or any(len(secret) < MIN_SECRET_BYTES for secret in secrets):
        raise SecretUnusable(file, f"each line must hold {MIN_SECRET_BYTES} bytes or more")
    return secrets


def _secret(line: bytes, file: Path) -> bytes:
    if not line.startswith(b"whsec_"):
        return line
    try:
        return base64.b64decode(line.removeprefix(b"whsec_"), validate=True)
    except ValueError:
        raise SecretUnusable(file, "what follows whsec_ is not base64") from None


class SecretUnusable(DaemonError, code="webhook-secret"):
    """A secret file cannot be read, or a secret is too short."""

    def __init__(self, file: Path, what: str) -> None:
        super().__init__(f"webhook secret {file}: {what}", f"make one: openssl rand -hex 32 > {file}")


log = logging.getLogger(__name__)

ANSWER_LIMIT_S = 10.0
MIN_PAUSE_S, MAX_PAUSE_S = 1.0, 300.0
POLL_S = 5.0
"""The outbox is read at least this often; normally it signals new messages."""

PERMANENT_REFUSALS = frozenset({400, 406, 411, 413, 415, 422, 431})
"""Statuses that repeating will not change: after MAX_ATTEMPTS_WHEN_REFUSED the message is skipped."""

MAX_ATTEMPTS_WHEN_REFUSED = 8

MIN_FAILURES_TO_WARN = 3


def pause_s(failures: int, chance: float) -> float:
    """Pause after failed attempts: doubles from 1 s to 300 s, times 0.5 to 1 by `chance` in 0..1 (jitter)."""
    return float(min(MAX_PAUSE_S, MIN_PAUSE_S * 2 ** min(failures - 1, 20)) * (0.5 + 0.5 * chance))


@dataclass(eq=False)
class WebhookDispatcher(SectionService):
    """Background service: one task for each webhook."""

    webhooks: tuple[WebhookSettings, ...]
    outbox: Outbox
    clock: Clock
    chance: Callable[[], float]
    failures: Counter[str] = field(default_factory=Counter)
    """Failed attempts of each receiver since it last accepted a message."""

    _refusals: Counter[str] = field(default_factory=Counter, init=False)
    """Of them those that refused the message at hand for good: what is away refuses nothing."""

    _tasks: list[asyncio.Task[None]] = field(default_factory=list, init=False)

    async def start(self) -> None:
        """Read the files and start the tasks. Raises SecretUnusable, CertificateUnusable, StorageError."""
        files = [_read_files(webhook) for webhook in self.webhooks]
        for webhook in self.webhooks:
            await self.outbox.subscribe(webhook.receiver)
        for webhook, (secrets, trusted) in zip(self.webhooks, files, strict=True):
            self._tasks.append(asyncio.create_task(self._serve(webhook, secrets, trusted)))

    async def stop(self) -> None:
        """Stop the tasks; undelivered messages stay in the outbox."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def change(self, webhooks: tuple[WebhookSettings, ...]) -> None:
        """Serve these receivers from now on. Raises as `start`; then those before go on."""
        for webhook in webhooks:
            _read_files(webhook)
        await self.stop()
        self._tasks.clear()
        self.webhooks = webhooks
        self.failures.clear()
        self._refusals.clear()
        await self.start()

    def warnings(self) -> list[str]:
        """A warning for each receiver with MIN_FAILURES_TO_WARN or more failed attempts."""
        return [
            Sentence("webhook-refused", receiver=name, attempts=count)
            for name, count in self.failures.items()
            if count >= MIN_FAILURES_TO_WARN
        ]

    def families(self) -> Iterable[Metric]:
        failures: dict[Labels, float] = {
            (("receiver", webhook.receiver),): float(self.failures[webhook.receiver]) for webhook in self.webhooks
        }
        about = "Attempts since a receiver last took something."
        return [Metric("handeyed_webhook_failures", "gauge", about, failures)]

    async def _serve(self, webhook: WebhookSettings, secrets: tuple[bytes, ...], trusted: Trusted) -> None:
        limits = httpx.Timeout(ANSWER_LIMIT_S)
        async with httpx.AsyncClient(verify=trusted, timeout=limits, trust_env=False, follow_redirects=False) as client:
            while True:
                try:
                    await self._next(webhook, secrets, client)
                except StorageError as error:
                    log.warning("webhook %s: the outbox cannot be read: %s", webhook.receiver, error)
                    await self.clock.sleep(POLL_S)

    async def _next(self, webhook: WebhookSettings, secrets: tuple[bytes, ...], client: httpx.AsyncClient) -> None:
        """Deliver the next message, or wait for one up to POLL_S."""
        name, changed = webhook.receiver, self.outbox.changed
        message = await self.outbox.next(name)
        if message is None:
            with suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), POLL_S)
            return
        if webhook.topics and message.topic not in webhook.topics:
            await self.outbox.acknowledge(name, message.number)
            return
        refused = await self._send(webhook, message, secrets, client)
        self.failures[name] += 1
        self._refusals[name] += refused in PERMANENT_REFUSALS
        if refused is None or self._refusals[name] >= MAX_ATTEMPTS_WHEN_REFUSED:
            if refused is not None:
                log.error("webhook %s never takes message %s (HTTP %d): it is left out", name, message.id, refused)
            self.failures[name] = self._refusals[name] = 0
            await self.outbox.acknowledge(name, message.number)
            return
        await self.clock.sleep(pause_s(self.failures[name], self.chance()))

    async def _send(
        self, webhook: WebhookSettings, message: OutboxMessage, secrets: tuple[bytes, ...], client: httpx.AsyncClient
    ) -> int | None:
        """Post the message once. Returns None when it was accepted (2xx), else the status, 0 without an answer."""
        body = body_of(message)
        headers = signature_headers(message.id, int(self.clock.utc_now().timestamp()), body, secrets)
        try:
            async with (
                asyncio.timeout(2 * ANSWER_LIMIT_S),
                client.stream("POST", webhook.url, content=body, headers=headers) as answer,
            ):
                status = answer.status_code  # the body is ignored
        except (httpx.HTTPError, httpx.InvalidURL, TimeoutError) as error:
            status, why = 0, str(error) or type(error).__name__
        else:
            why = f"HTTP {status}"
        if 200 <= status < 300:
            return None
        if self.failures[webhook.receiver] == 0:
            log.warning("webhook %s does not take message %s: %s", webhook.receiver, message.id, why)
        return status


def _read_files(webhook: WebhookSettings) -> tuple[tuple[bytes, ...], Trusted]:
    trusted = trusting(webhook.ca_file) if webhook.ca_file else True
    return read_secrets(Path(webhook.secret_file)), trusted


def body_of(message: OutboxMessage) -> bytes:
    """The JSON body of a message, the same at every attempt."""
    document = {"id": message.id, "type": message.topic, "timestamp": message.at, "data": message.data}
    return json.dumps(document, separators=(",", ":"), sort_keys=True).encode()
