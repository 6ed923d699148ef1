"""A MES that retries: the same Idempotency-Key never does a thing twice, also over a restart."""

import asyncio
import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from calibration.documents.pose import PoseDocument
from daemon.model.records import AppliedCalibration, CalibrationRecord
from tests.daemon.calibrations import a_calibration, apply_calibration
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.fakes import Gate, ply_of

KEY = {"idempotency-key": "8e03978e-40d5-43dd-bc93-6894a57f9324"}
OTHER = {"idempotency-key": '"another-key-in-quotes"'}


def replayed(answer: httpx.Response) -> bool:
    return answer.headers.get("idempotency-replayed") == "true"


async def test_a_retry_is_answered_with_the_same_run_as_it_is_now(bench: Bench) -> None:
    first = await bench.client.post("/calibrate", headers=KEY, json={"count": 3})
    assert (first.status_code, first.json()["over"]) == (202, False)
    again = await bench.client.post("/calibrate?wait=200", headers=KEY, json={"count": 3})
    assert (again.status_code, again.json()["state"]) == (200, "finished")
    assert again.json() == (await bench.client.get(first.headers["location"])).json()
    text = await bench.client.post("/calibrate", headers={**KEY, "accept": "text/plain"}, json={"count": 3})
    assert (text.status_code, first.json()["id"] in text.text, replayed(text)) == (200, True, True)
    unusable = await bench.client.post("/calibrate?wait=soon", headers=KEY, json={"count": 3})
    assert (unusable.status_code, unusable.json()["problems"][0]["place"]) == (422, "query.wait")
    assert again.headers["location"] == first.headers["location"]
    assert (replayed(first), replayed(again)) == (False, True)
    other = await bench.client.post("/calibrate?wait=200", headers=OTHER, json={"count": 3})
    assert other.json()["id"] != first.json()["id"]
    assert len((await bench.client.get("/runs")).json()["runs"]) == 2


async def test_the_key_with_another_request_is_refused(bench: Bench) -> None:
    await bench.client.post("/scans", headers=KEY, json={"name": "door"})
    others: list[tuple[str, Any]] = [("/scans", {"name": "roof"}), ("/scans", {}), ("/calibrate", {"name": "door"}),
                                     ("/scans?x=1", {"name": "door"})]  # fmt: skip
    for path, body in others:
        answer = await bench.client.post(path, headers=KEY, json=body)
        assert (answer.status_code, answer.json()["code"]) == (422, "idempotency-key-reused")
    same = await bench.client.post("/scans?wait=3", headers=KEY, json={"name": "door"})  # how long is not what
    assert replayed(same)
    assert len((await bench.client.get("/scans")).json()["scans"]) == 1


async def test_while_the_first_is_in_flight_the_second_learns_whose_run_to_follow(tmp_path: Path) -> None:
    gate = Gate(at_move=2)
    parts = Parts()
    parts.robot.before_move = gate
    async with serving(settings_for(tmp_path), parts) as bench:
        first = asyncio.create_task(bench.client.post("/calibrate?wait=200", headers=KEY))
        await gate.reached.wait()
        second = await bench.client.post("/calibrate?wait=200", headers=KEY)
        assert (second.status_code, second.json()["code"]) == (409, "request-in-flight")
        run = second.json()["holder"]
        gate.open.set()
        assert (await first).json()["id"] == run
        third = await bench.client.post("/calibrate?wait=200", headers=KEY)
        assert replayed(third)
        assert third.json()["state"] == "finished"


async def test_a_refusal_that_did_nothing_is_not_remembered(bench: Bench) -> None:
    bench.robot.status["motors_on"] = False
    assert (await bench.client.post("/calibrate", headers=KEY)).json()["code"] == "cell-not-ready"
    bench.robot.status["motors_on"] = True
    assert (await bench.client.post("/calibrate", headers=KEY)).status_code == 202


async def test_a_key_that_cannot_be_one_is_refused(bench: Bench) -> None:
    for key in ("", '""', '"open', "in the middle", "x" * 256, "käse", "tab\there"):
        answer = await bench.client.post("/calibrate", headers=httpx.Headers([(b"idempotency-key", key.encode())]))
        assert (answer.status_code, answer.json()["code"]) == (422, "request-refused")
        assert answer.json()["problems"][0]["place"] == "header.Idempotency-Key"
    assert not bench.robot.goals


async def test_quotes_are_not_part_of_a_key(bench: Bench) -> None:
    plain = await bench.client.post("/scans", headers={"idempotency-key": "k"})
    quoted = await bench.client.post("/scans", headers={"idempotency-key": '"k"'})
    assert quoted.json() == plain.json()


async def test_two_keys_in_one_request_are_refused(bench: Bench) -> None:
    answer = await bench.client.post("/calibrate", headers=[("idempotency-key", "a"), ("idempotency-key", "b")])
    assert answer.status_code == 422


async def test_a_view_is_stored_once_however_often_it_is_sent(tmp_path: Path) -> None:
    content = ply_of(cloud(20_000))
    async with serving(settings_for(tmp_path)) as bench:
        scan = (await bench.client.post("/scans", headers=OTHER, json={"name": "door"})).json()
        link, query = scan["links"]["views"], {"pose": POSES[0]}
        first = await bench.client.post(link, params=query, content=content, headers={**PLY, **KEY})
        again = await bench.client.post(link, params=query, content=content, headers={**PLY, **KEY})
        assert (first.status_code, replayed(first)) == (201, False)
        assert (again.status_code, again.content, replayed(again)) == (201, first.content, True)
        changed = await bench.client.post(link, params=query, content=content[:-1] + b"x", headers={**PLY, **KEY})
        assert changed.json()["code"] == "idempotency-key-reused"
        assert len((await bench.client.get(scan["links"]["self"])).json()["views"]) == 1


async def test_a_registered_cloud_is_the_same_again_though_another_calibration_is_in_force_and_the_arm_elsewhere(
    bench: Bench,
) -> None:
    await apply_calibration(bench)
    content = ply_of(cloud(50_000))
    first = await bench.client.post("/register?pose=now", content=content, headers={**PLY, **KEY})
    await _apply_another(bench)
    bench.robot.base_T_flange[0, 3] += 100.0
    again = await bench.client.post("/register?pose=now", content=content, headers={**PLY, **KEY})
    assert replayed(again)
    assert again.content == first.content
    other = await bench.client.post("/register?pose=now", content=content, headers=PLY)
    assert other.content != first.content
    small = await bench.client.post("/register?pose=now", content=ply_of(cloud(10)), headers={**PLY, **KEY})
    assert small.json()["code"] == "idempotency-key-reused"


async def _apply_another(bench: Bench) -> None:
    document = a_calibration("another").model_copy(update={"flange_T_camera": PoseDocument.of(np.eye(4))})
    store = bench.application.store
    await store.save_calibration(CalibrationRecord("another", None, document.created_at, True, document))
    await store.apply(AppliedCalibration("another", document.created_at, "test"))


async def test_the_answer_survives_a_restart(tmp_path: Path) -> None:
    settings = settings_for(tmp_path)
    async with serving(settings) as bench:
        first = await bench.client.post("/calibrate?wait=200", headers=KEY)
    async with serving(settings) as bench:
        again = await bench.client.post("/calibrate?wait=200", headers=KEY)
        assert replayed(again)
        assert again.json() == first.json()
        assert not bench.robot.goals


async def test_killed_before_it_answered_the_daemon_answers_from_what_it_stored(tmp_path: Path) -> None:
    """As after kill -9: the change and the key were stored in one transaction, the answer was not."""
    settings = settings_for(tmp_path)
    async with serving(settings) as bench:
        for path, had in (("/scans", "scan"), ("/calibrate", "run")):
            await bench.client.post(path, headers={"idempotency-key": had}, json={})
        document = a_calibration("good")
        store = bench.application.store
        await store.save_calibration(CalibrationRecord("good", None, document.created_at, True, document))
        await bench.client.post("/calibrations/good/apply", headers={"idempotency-key": "apply"}, json={})
        await store._database.write(lambda db: db.execute("UPDATE requests SET status = NULL, content = NULL"))
        effects = await store._database.read(lambda db: dict(db.execute("SELECT key, effect FROM requests").fetchall()))
        assert {key: effect.split()[0] for key, effect in effects.items()} == {k: k for k in ("scan", "run", "apply")}
    async with serving(settings) as bench:
        for path, key in (("/scans", "scan"), ("/calibrate", "run"), ("/calibrations/good/apply", "apply")):
            answer = await bench.client.post(path, headers={"idempotency-key": key}, json={})
            assert answer.is_success, answer.text
            assert replayed(answer)
            assert effects[key].split()[1] in json.dumps(answer.json())
        assert len((await bench.client.get("/runs")).json()["runs"]) == 1
        assert len((await bench.client.get("/scans")).json()["scans"]) == 1
        assert len((await bench.client.get("/calibrations")).json()["applied"]) == 1


async def test_a_key_that_was_only_noted_is_free_after_a_restart(tmp_path: Path) -> None:
    settings = settings_for(tmp_path)
    async with serving(settings) as bench:
        keyed = bench.application.store.idempotency_keys
        assert await keyed.begin("local", KEY["idempotency-key"], "head", "2026-11-21T09:00:00.000Z") is None
    async with serving(settings) as bench:
        answer = await bench.client.post("/calibrate?wait=200", headers=KEY)
        assert (answer.status_code, replayed(answer)) == (200, False)
