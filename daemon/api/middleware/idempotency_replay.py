"""Rebuild the answer to a request that was carried out but not answered, because the daemon was killed."""

from pydantic import BaseModel

from daemon.api.extension import Extensions, Rebuild, Rebuilt
from daemon.api.schemas.calibrations import AppliedDocument
from daemon.api.schemas.rigs import StoredRig
from daemon.api.schemas.scans import ScanDocument, ScanViewDocument
from daemon.application import Application


async def rebuild_answer(app: Application, effect: str, added: Extensions = ()) -> Rebuilt:
    """The answer from the stored effect, such as "scan ID"; not of a run. Raises NotFound, StorageError."""
    kind, _, subject = effect.partition(" ")
    rebuilders = _REBUILDERS | {noun: how for extension in added for noun, how in extension.rebuilders.items()}
    return await rebuilders[kind](app, subject)


def _json(status: int, document: BaseModel, location: str) -> Rebuilt:
    headers = {"content-type": "application/json", "location": location}
    return status, headers, document.model_dump_json().encode()


async def _scan(app: Application, scan_id: str) -> Rebuilt:
    scan = await app.store.scan(scan_id)
    return _json(201, ScanDocument.of(scan, await app.store.scan_views(scan_id)), f"/scans/{scan_id}")


async def _view(app: Application, subject: str) -> Rebuilt:
    scan_id, _, number = subject.partition(" ")
    view = (await app.store.scan_views(scan_id))[int(number)]
    return _json(201, ScanViewDocument.of(view), f"/scans/{scan_id}")


async def _apply(app: Application, sequence: str) -> Rebuilt:
    applied = await app.store.history_entry(int(sequence))
    return _json(200, AppliedDocument.of(applied), "/calibrations/current")


async def _acceptance(app: Application, acceptance_id: str) -> Rebuilt:
    stored = await app.store.acceptances.get(acceptance_id)
    headers = {"content-type": "application/json", "location": f"/acceptances/{acceptance_id}"}
    return 200, headers, stored.document.encode()


async def _rig(app: Application, rig_id: str) -> Rebuilt:
    return _json(201, StoredRig.of_record(await app.store.rigs.get(rig_id)), f"/rigs/{rig_id}")


_REBUILDERS: dict[str, Rebuild] = {
    "scan": _scan,
    "view": _view,
    "apply": _apply,
    "acceptance": _acceptance,
    "rig": _rig,
}
