"""finished.json in the target: what two listings said of the files of each finished scan, so that none is read again.

It may be deleted: then, as for a file that has changed, the contents are compared.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from daemon.tools.batch_registration.errors import ArchiveError
from daemon.tools.batch_registration.executors import Executor
from daemon.tools.batch_registration.remote_folder import Listing, RemoteFolder
from daemon.tools.batch_registration.tasks import OutcomeDocument, RegistrationTask
from registration.errors import RegistrationError

FINISHED_NAME = "finished.json"

SAVE_EVERY = 1000
"""Scans after which it is written, which takes a listing; what was finished later is compared by content."""


@dataclass(frozen=True)
class FinishedScans:
    """The finished scans of an archive. `listed`: the source, before anything is read of it."""

    target: RemoteFolder
    listed: Listing

    def run(self, tasks: Sequence[RegistrationTask], execute: Executor) -> Iterator[OutcomeDocument]:
        """Outcomes of the tasks, first those of scans whose files are as they were. Raises ArchiveError, OSError."""
        known: dict[str, OutcomeDocument] = {}
        with suppress(ArchiveError, OSError, RecursionError, TypeError, ValueError, AttributeError):
            rows = json.loads(self.target.read(FINISHED_NAME) or b"{}")
            known = {mark: OutcomeDocument(**row) for mark, row in rows.items()}
        results = self.target.list_marks()
        outcomes = [known[mark] for task in tasks if (mark := self._mark(task, results)) in known]
        yield from outcomes
        done = {outcome.scan for outcome in outcomes}
        try:
            for outcome in execute([task for task in tasks if task.scan not in done]):
                outcomes.append(outcome)
                yield outcome
                if len(outcomes) % SAVE_EVERY == 0:
                    self._save(tasks, outcomes)
        finally:
            if len(outcomes) > len(done):
                self._save(tasks, outcomes)

    def _save(self, tasks: Sequence[RegistrationTask], outcomes: Sequence[OutcomeDocument]) -> None:
        with suppress(ArchiveError, OSError, RegistrationError):  # the results are there; the next run reads them
            results = self.target.list_marks()
            marks = {task.scan: self._mark(task, results) for task in tasks}
            rows = {
                marks[outcome.scan]: outcome.model_copy(update={"state": "unchanged"}).model_dump()
                for outcome in outcomes
                if outcome.state != "failed" and marks[outcome.scan]
            }
            self.target.write(FINISHED_NAME, json.dumps(rows).encode())

    def _mark(self, task: RegistrationTask, results: Listing) -> str:
        """SHA-256 over the options and what the listings say of the files; empty where they say too little."""
        files = [(place, name, mark) for place, listing in enumerate((self.listed, results))
                 for name, mark in sorted(listing.get(task.scan, {}).items()) if name != FINISHED_NAME]  # fmt: skip
        if not all(mark for _, _, mark in files):
            return ""
        return hashlib.sha256(json.dumps([task.scan, task.about.decode(), files]).encode()).hexdigest()
