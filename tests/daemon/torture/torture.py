"""kill -9, again and again, at random and at every failpoint, and a check of what was acknowledged.

Each round starts a daemon on what the last one left, checks that everything that was ever acknowledged is there and
nothing is half there, sends the request that got no answer once more, works on, and is killed. The devices are the
tests' fakes; server, store, files, and the failpoints are what runs in a plant.
"""

import contextlib
import multiprocessing
import random
import shutil
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import httpx
import numpy as np

from daemon.runtime.failpoints import PLACES
from tests.daemon.clouds import POSE
from tests.daemon.fakes import ply_of
from tests.daemon.torture.ledger import Ledger, Lost, Request
from tests.daemon.torture.tortured_daemon import STATIONS, WARM, daemon_process
from tests.support.waiting import LIMIT_S

ROUNDS_A_STORE = 25

AT_FAILPOINTS = 0.7
"""Of the rounds; the others are killed at random."""


@dataclass
class TortureReport:
    """Rounds done, times to readiness, kills by place, and what was lost, if anything."""

    rounds: int = 0
    ready_s: list[float] = field(default_factory=list)
    killed: Counter[str] = field(default_factory=Counter)
    lost: str = ""


class Torture:
    """One store after the other, many daemons."""

    def __init__(self, folder: Path, chance: random.Random) -> None:
        self._folder, self._chance = folder, chance
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(WARM)
        warm = self._context.Process(target=int)  # the fork server's own imports are no start of a daemon
        warm.start()
        warm.join()
        self.report = TortureReport()
        self._most = dict.fromkeys(PLACES, STATIONS)
        self._whole_round_s = 1.0
        self._begin()

    def _begin(self) -> None:
        shutil.rmtree(self._folder / "store", ignore_errors=True)
        (self._folder / "moves").write_text("")
        self._ledger, self._pending = Ledger(), None

    def round(self, number: int) -> None:
        """Start, check, go on, be killed. Raises Lost."""
        if number % ROUNDS_A_STORE == 0:
            self._begin()
        place, nth = "", 0
        if self._chance.random() < AT_FAILPOINTS:
            place = PLACES[number % len(PLACES)]
            nth = self._chance.randint(1, self._most[place])
        moves = (self._folder / "moves").read_text()
        ours, theirs = self._context.Pipe()
        began_s = time.monotonic()
        child = self._context.Process(
            target=daemon_process, args=(str(self._folder / "store"), place, nth, theirs), daemon=True
        )
        child.start()
        theirs.close()
        timer = threading.Timer(self._chance.uniform(0, self._whole_round_s), child.kill)
        if not place:
            timer.start()
        try:
            self.report.killed[self._until_killed(ours, moves, place or "at random", began_s)] += 1
        finally:
            timer.cancel()
            child.kill()
            child.join()
        self._learn()
        self.report.rounds = number + 1

    def _until_killed(self, ready: Connection, moves: str, place: str, began_s: float) -> str:
        """Where it was."""
        try:
            url = ready.recv()
        except (EOFError, ConnectionResetError):  # the next one goes on
            return f"{place}, while starting"
        self.report.ready_s.append(time.monotonic() - began_s)
        try:
            with httpx.Client(base_url=url, timeout=LIMIT_S, verify=False, trust_env=False) as client:
                self._work(client, moves)
        except httpx.HTTPError:
            return place
        self._whole_round_s = time.monotonic() - began_s
        return "at the end"

    def _learn(self) -> None:
        """How often a place can be reached in a round."""
        with contextlib.suppress(FileNotFoundError):
            for place, count in Counter((self._folder / "places").read_bytes()).items():
                self._most[PLACES[place]] = max(self._most[PLACES[place]], count)

    def _work(self, client: httpx.Client, moves: str) -> None:
        self._ledger.check(client, self._folder / "store", self._pending)
        if (self._folder / "moves").read_text() != moves:
            raise Lost("the arm moved, and nobody had asked")
        if self._pending is not None:
            self._send(client, self._pending)
        scan = self._send(client, Request("scan", "/scans", {"name": "part"}))
        for _ in range(2):
            self._send(client, Request("view", f"/scans/{scan['id']}/views?pose={POSE}", self._cloud()))
        run = self._send(client, Request("run", "/calibrate?wait=200", {"count": STATIONS}))
        if run["state"] == "finished":
            self._send(client, Request("apply", f"/calibrations/{run['id']}/apply", {"despite_verdict": True}))

    def _send(self, client: httpx.Client, request: Request) -> dict[str, object]:
        if request is not self._pending:
            self._ledger.sent[request.kind] += 1
        self._pending = request
        answer = request.send(client)
        self._ledger.acknowledged(request, answer, client)
        self._pending = None
        return answer

    def _cloud(self) -> bytes:
        return ply_of(np.random.default_rng(self._chance.randrange(2**32)).normal(0, 100, (2000, 3)))
