"""Rebuild the answer to a request that was carried out but not answered, because the daemon was killed."""

from collections.abc import Awaitable, Callable

from pydantic import BaseModel

from daemon.api.schemas.calibrations import AppliedDocument
from daemon.api.schemas.rigs import StoredRig
from daemon.api.schemas.scans import ScanDocument, ScanViewDocument
from daemon.api.schemas.touches import StoredTouch
from daemon.application import Application

Answer = tuple[int, dict[str, str], bytes]


async def rebuild_answer(app: Application, effect: str) -> Answer:
    """The answer from the stored effect, such as "scan ID"; not of a run. Raises NotFound, StorageError."""
    kind, _, subject = effect.partition(" ")
    return await _REBUILDERS[kind](app, subject)


def _json(status: int, document: BaseModel, location: str) -> Answer:
    headers = {"content-type": "application/json", "location": location}
    return status, headers, document.model_dump_json().encode()


async def _scan(app: Application, scan_id: str) -> Answer:
    scan = await app.store.scan(scan_id)
    return _json(201, ScanDocument.of(scan, await app.store.scan_views(scan_id)), f"/scans/{scan_id}")


async def _view(app: Application, subject: str) -> Answer:
    scan_id, _, number = subject.partition(" ")
    view = (await app.store.scan_views(scan_id))[int(number)]
    return _json(201, ScanViewDocument.of(view), f"/scans/{scan_id}")


async def _apply(app: Application, sequence: str) -> Answer:
    applied = await app.store.history_entry(int(sequence))
    return _json(200, AppliedDocument.of(applied), "/calibrations/current")


async def _acceptance(app: Application, acceptance_id: str) -> Answer:
    stored = await app.store.acceptances.get(acceptance_id)
    headers = {"content-type": "application/json", "location": f"/acceptances/{acceptance_id}"}
    return 200, headers, stored.document.encode()


async def _touch(app: Application, touch_id: str) -> Answer:
    stored = StoredTouch.of_record(await app.store.touch_tests.get(touch_id))
    return _json(201, stored, f"/touches/{touch_id}")


async def _rig(app: Application, rig_id: str) -> Answer:
    return _json(201, StoredRig.of_record(await app.store.rigs.get(rig_id)), f"/rigs/{rig_id}")


_REBUILDERS: dict[str, Callable[[Application, str], Awaitable[Answer]]] = {
    "scan": _scan,
    "view": _view,
    "apply": _apply,
    "acceptance": _acceptance,
    "touch": _touch,
    "rig": _rig,
}
