"""Saves one record of each kind to a store, and checks afterwards that what was acknowledged is there completely."""

from collections.abc import Awaitable, Callable, Collection
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from calibration.documents.pose import PoseDocument
from daemon.access.browser_sessions import BrowserSession
from daemon.access.keys import KeyRecord
from daemon.errors import NoCalibration, NotFound, StorageError, StorageInconsistent
from daemon.model.records import AppliedCalibration, CalibrationRecord, FlangePose, ScanRecord
from daemon.model.run_states import RunState
from daemon.runtime.durable_files import make_folder
from daemon.runtime.event_bus import BusEvent
from daemon.store.actor import AuditContext
from daemon.store.audit_log import check_audit_log
from daemon.store.database import DATABASE_NAME
from daemon.store.documents import DocumentKind, DocumentRecord, Documents
from daemon.store.store import Store
from tests.daemon.calibrations import a_calibration, an_arm
from tests.daemon.fakes import ply_of
from tests.daemon.records import AT, a_run

PICTURE = b"\x89PNG" + bytes(20_000)

KEY = KeyRecord("k", "Ann", "operator", "h", AT)
SESSION = BrowserSession("kept", "k", "operator", AT, "2099-01-01T00:00:00Z", AT, "192.0.2.7", paired=False)
ENDED = replace(SESSION, hash="ended")
REQUEST = ("Ann", "key", "POST /scans")
NOBODY = AuditContext()

Step = Callable[[], Awaitable[object]]


async def pending_counts(store: Store) -> dict[str, int]:
    """The number of messages each webhook has not received yet, by name."""
    query = "SELECT name, (SELECT count(*) FROM outbox WHERE number > delivered) FROM webhooks ORDER BY name"
    return dict(await store.outbox._database.read(lambda db: db.execute(query).fetchall()))


def save_steps(store: Store) -> dict[str, Step]:
    """What saves one record of each kind, by name and in order."""
    run, scan = a_run("r"), ScanRecord("s", AT, "door")
    calibration = CalibrationRecord("c", "r", AT, True, a_calibration("c"))
    upload, pose, cloud = store.scan_folder("s") / ".upload.ply", PoseDocument.of(np.eye(4)), ply_of(np.ones((500, 3)))

    async def view() -> None:
        try:
            make_folder(upload.parent)
            upload.write_bytes(cloud)
        except OSError as error:
            raise StorageError(str(error), "") from None
        await store.add_scan_view("s", upload, "mm", FlangePose(pose), AT, points=500)

    return {
        "run": lambda: store.save_run(run),
        "picture": lambda: store.write_file(store.run_folder("r") / "view_000.png", [PICTURE]),
        "session": lambda: store.write_file(store.run_folder("r") / "session.json", [b'{"views": 1}']),
        "session again": lambda: store.write_file(store.run_folder("r") / "session.json", [b'{"views": 2}']),
        "calibration": lambda: store.save_calibration(calibration, an_arm()),
        "applied": lambda: store.apply(AppliedCalibration("c", AT, "Ann")),
        "run over": lambda: store.save_run(replace(run, state=RunState.FINISHED)),
        "scan": lambda: store.save_scan(scan),
        "view": view,
        "event": lambda: store.stored_events.keep([BusEvent(7, "run", {})]),
        "audit": lambda: store.audit.append(NOBODY, AT, "x", "y"),
        "key": lambda: store.access_keys.add(KEY, NOBODY),
        "session kept": lambda: store.browser_sessions.begin(SESSION, "Ann"),
        "session begun": lambda: store.browser_sessions.begin(ENDED, "Ann"),
        "session ended": lambda: store.browser_sessions.end(ENDED.hash, AT, NOBODY),
        "key revoked": lambda: store.access_keys.revoke(KEY.id, AT, NOBODY),
        "request": lambda: store.idempotency_keys.begin(*REQUEST, AT),
        "answer": lambda: store.idempotency_keys.save_answer(*REQUEST[:2], "{}", 201, {}, PICTURE),
        "webhook": lambda: store.outbox.subscribe("mes"),
        "message": lambda: store.outbox.post("drift", AT, {}),
        **{name: partial(table.save, a_document(name)) for name, table in documents_of(store).items()},
        "anchor": store.audit.anchor,
    }


TOUCH_TESTS = DocumentKind("touch_tests", "touch", "calibration_id")
RIGS = DocumentKind("rigs", "rig", "setup")
"""Of extensions: the store does not know them."""


class About(BaseModel):
    name: str


def documents_of(store: Store) -> dict[str, Documents]:
    of_extensions = {"touch test": TOUCH_TESTS, "rig": RIGS}
    return {"acceptance": store.acceptances} | {name: store.documents(kind) for name, kind in of_extensions.items()}


def a_document(name: str) -> DocumentRecord:
    return DocumentRecord(name, "c", AT, "Ann", About(name=name * 300).model_dump_json())


async def find_losses(folder: Path, done: Collection[str]) -> list[str]:
    """What was acknowledged (`done`) and is not in the store, or is there in part."""
    store = Store(folder)
    wrong: list[str] = [] if store.fault is None else [store.fault.what]

    def expect(name: str, there: bool, what: str = "is not there") -> None:
        if name in done and not there:
            wrong.append(f"{name} was acknowledged and {what}")

    try:
        run = await store.run("r")
        expect("run over", run.state is RunState.FINISHED, f"the run is {run.state}")
    except NotFound:
        expect("run", False)
    picture, session = store.run_folder("r") / "view_000.png", store.run_folder("r") / "session.json"
    expect("picture", picture.exists())
    if picture.exists() and picture.read_bytes() != PICTURE:
        wrong.append("the picture is torn")
    text = session.read_text() if session.exists() else ""
    allowed = {'{"views": 2}'} if "session again" in done else {'{"views": 1}', '{"views": 2}'}
    if text not in (allowed if {"session", "session again"} & {*done} else {"", *allowed}):
        wrong.append(f"session.json says {text!r} after {done}")
    try:
        await store.calibration("c")
        expect("calibration", await store.arm("c") is not None, "is without its arm")
    except NotFound:
        expect("calibration", False)
    try:
        await store.current()
    except NoCalibration:
        expect("applied", False)
    try:
        await store.scan("s")
        views = await store.scan_views("s")
        expect("view", len(views) == 1)
        for view in views:
            file = store.scan_folder("s") / view.file
            if not file.exists() or file.stat().st_size < 6000:
                wrong.append("the view is torn, or not there")
    except NotFound:
        expect("scan", False)
    expect("event", any(event.number == 7 for event in await store.stored_events.last()))
    expect("audit", any(row.action == "x" for row in await store.audit.rows(100, None)))
    await _expect_access(store, done, expect)
    for name, table in documents_of(store).items():
        try:
            if (await table.get(name)).parsed(About) != About(name=name * 300):
                wrong.append(f"the {name} is torn")
        except NotFound:
            expect(name, False)
        except StorageInconsistent:
            wrong.append(f"the {name} is damaged, as the store says when it is read")
    waiting = await pending_counts(store)
    expect("webhook", "mes" in waiting)
    expect("message", "webhook" not in done or waiting.get("mes", 0) > 0)
    await store.close()
    return wrong + check_audit_log(folder / DATABASE_NAME, [])[1]


async def _expect_access(store: Store, done: Collection[str], expect: Callable[..., None]) -> None:
    """Keys and sessions are as they were acknowledged; what was ended opens nothing; a request has its answer."""
    keys = {key.id: key for key in await store.access_keys.all()}
    expect("key", KEY.id in keys)
    expect("key revoked", KEY.id in keys and not keys[KEY.id].valid(AT), "is valid again")
    sessions = await store.browser_sessions.all()
    expect("session kept", SESSION.hash in sessions)
    expect("session ended", ENDED.hash not in sessions, "is there again")
    if {"request", "answer"} <= {*done} and store.fault is None:
        found = await store.idempotency_keys.begin(*REQUEST, AT)
        expect("answer", found is not None and found.content == PICTURE)
