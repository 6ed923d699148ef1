"""What the operator's page asks beside the runs: devices, arm, plans, keys, filters, settings, help, audit."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from daemon.access.roles import Role
from daemon.model.run_states import RunState
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.calibrations import a_calibration, apply_calibration
from tests.daemon.cell_under_test import Bench, pose_json, serving, settings_for
from tests.daemon.fakes import BASE_T_TARGET, FLANGE_T_CAMERA, Gate
from tests.daemon.records import a_run
from tests.support.waiting import LIMIT_S

ARM = {"model": "IRB 1600-6/1.45"}


async def test_devices_show_their_links_and_no_passwords(tmp_path: Path) -> None:
    camera = {"address": "http://ann:sesame@camera/frame.png"}
    async with serving(settings_for(tmp_path, camera=camera)) as bench:
        bench.robot.lost = True
        devices = {device["name"]: device for device in (await bench.client.get("/devices")).json()}
        assert list(devices) == ["robot", "camera", "scanner"]
        assert (devices["robot"]["kind"], devices["robot"]["connected"]) == ("tcp", False)
        assert devices["robot"]["last_error"]["fix"]
        assert devices["camera"]["last_error"] is None
        assert "sesame" not in str(devices)
        assert bench.robot.requests == bench.camera.pictures == 0


async def test_a_check_looks_at_everything_and_moves_nothing(bench: Bench) -> None:
    bench.robot.status["motors_on"] = False
    results = {row["name"]: row for row in (await bench.client.post("/check")).json()["results"]}
    assert {name: row["ok"] for name, row in results.items()} == {
        "storage": True, "robot": False, "camera": True, "scanner": True,
    }  # fmt: skip
    assert "motors are off" in results["robot"]["what"]
    assert "88 of the target's 88 points" in results["camera"]["what"]
    assert not bench.robot.goals
    assert bench.scanner.scans == 0


async def test_a_check_and_a_plan_wait_for_no_run(bench: Bench) -> None:
    bench.robot.before_move = gate = Gate(at_move=1)
    location = (await bench.client.post("/calibrate")).headers["location"]
    await gate.reached.wait()
    run_id = location.removeprefix("/runs/")
    for path in ("/check", "/plan", f"/calibrations/{run_id}/solve"):
        answer = await bench.client.post(path)
        assert (answer.status_code, answer.json()["code"]) in ((409, "cell-busy"), (409, "run-in-progress")), path
    assert bench.camera.pictures == 0
    gate.open.set()
    await bench.run_over(location)


async def test_what_does_not_change_is_said_once(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, robot=ARM)) as bench:
        arm = (await bench.client.get("/arm")).json()
        assert (arm["model"], len(arm["limits_deg"]), arm["moves"]) == (ARM["model"], 6, True)
        assert len(arm["taught_poses"]) == 5
        assert len(arm["target_points_mm"]) == 88
        assert bench.robot.requests == 0


@pytest.mark.slow
@pytest.mark.parametrize("lens", ["given", "not given"])
async def test_a_plan_moves_nothing_and_says_what_the_views_will_tell(tmp_path: Path, lens: str) -> None:
    camera, target = pose_json(FLANGE_T_CAMERA), pose_json(BASE_T_TARGET)
    guesses = {"poses": [], "flange_T_camera_guess": camera, "base_T_target_guess": target}
    unknown = {} if lens == "given" else {"camera": {"intrinsics": None}}
    async with serving(settings_for(tmp_path, robot=ARM, calibration=guesses, **unknown)) as bench:
        answer = await bench.client.post("/plan", json={"count": 4})
        assert answer.status_code == 200, answer.text
        found = answer.json()
        assert len(found["poses"]) == len(found["predicted_mm"]) == 4
        assert found["predicted_mm"][0] is None
        assert found["predicted_mm"][3] > 0
        assert found["note"].startswith("the intrinsics are unknown") == (lens == "not given")
        assert len(found["poses"][0]["skeleton_mm"]) == 5
        assert not bench.robot.goals
        assert bench.camera.pictures == 0
        assert (await bench.client.get("/runs")).json()["runs"] == []


async def test_a_plan_of_taught_poses_is_those(bench: Bench) -> None:
    found = (await bench.client.post("/plan", json={"count": 3})).json()
    assert len(found["poses"]) == 3
    assert found["predicted_mm"] == [None] * 3


async def test_a_scene_that_is_not_known_is_found_by_the_run(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, calibration={"poses": []})) as bench:
        found = (await bench.client.post("/plan")).json()
        assert found["poses"] == []
        assert "small turns" in found["note"]


async def test_a_calibration_is_solved_again_with_what_has_been_found_out_since(bench: Bench) -> None:
    run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    link, expanded_mm = f"/calibrations/{run['id']}/solve", []
    for source in ("printed", "certified"):
        again = await bench.client.post(link, json={"known": {"target": {"source": source}}})
        assert again.status_code == 201, again.text
        expanded_mm.append(again.json()["accuracy"]["expanded_mm"])
    assert expanded_mm[0] == pytest.approx(run["result"]["expanded_mm"])
    assert expanded_mm[1] < expanded_mm[0]
    unknown = await bench.client.post(link, json={"known": {"camera": "good"}})
    assert (unknown.status_code, unknown.json()["problems"][0]["place"]) == (422, "known.camera")


async def test_a_calibration_is_solved_again_without_a_view(bench: Bench) -> None:
    run = (await bench.client.post("/calibrate", params={"wait": LIMIT_S})).json()
    again = await bench.client.post(f"/calibrations/{run['id']}/solve", json={"without": [2]})
    assert again.status_code == 201
    assert [view["index"] for view in again.json()["views"]] == [0, 1, 3, 4]
    stored = (await bench.client.get(again.headers["location"])).json()
    assert stored["id"] == again.json()["id"] != run["id"]
    summaries = {one["id"]: one for one in (await bench.client.get("/calibrations")).json()["calibrations"]}
    assert summaries[stored["id"]]["run_id"] == run["id"]
    assert (await bench.client.get("/calibrations/current")).status_code == 404
    assert (await bench.client.post("/calibrations/nowhere/solve")).status_code == 404


async def test_keys_are_made_rotated_and_revoked_by_admins(bench: Bench) -> None:
    admin = bearer((await bench.application.key_service.add("Ann", Role.ADMIN, TEST))[0])
    made = await bench.client.post("/keys", json={"name": "MES", "role": "operator"}, headers=admin)
    assert (made.status_code, made.json()["role"]) == (201, "operator")
    mes = bearer(made.json()["key"])
    assert (await bench.client.get("/runs", headers=mes)).status_code == 200
    assert (await bench.client.get("/keys", headers=mes)).json()["code"] == "role-too-low"
    rotated = await bench.client.post("/keys/MES/rotate", json={"overlap_h": 0}, headers=admin)
    assert (await bench.client.get("/runs", headers=mes)).status_code == 401
    new = bearer(rotated.json()["key"])
    assert (await bench.client.get("/runs", headers=new)).status_code == 200
    revoked = await bench.client.post("/keys/MES/revoke", headers=admin)
    assert revoked.json()["revoked"] == [rotated.json()["id"]]
    assert (await bench.client.get("/runs", headers=new)).status_code == 401
    listed = (await bench.client.get("/keys", headers=admin)).json()["keys"]
    assert [(key["name"], key["state"]) for key in listed] == [("Ann", "valid"), ("MES", "expired"), ("MES", "revoked")]
    assert "hash" not in listed[0]
    assert (await bench.client.post("/keys/MES/revoke", headers=admin)).status_code == 404
    again = {"idempotency-key": "k", **admin}
    first = await bench.client.post("/keys", json={"name": "PLC one", "role": "viewer"}, headers=again)
    second = await bench.client.post("/keys", json={"name": "PLC one", "role": "viewer"}, headers=again)
    assert (first.status_code, second.status_code) == (201, 409)  # a key in clear text is not kept for a repetition


FILTERS: dict[str, set[str]] = {
    "kind=verify": {"b"},
    "kind=calibration": {"a", "c"},
    "state=failed": {"c"},
    "kind=calibration&state=finished": {"a"},
    "since=2026-11-21": {"a", "b", "c"},
    "until=2026-11-21": set(),
    "since=2026-11-21T00:00:00Z&until=2027": {"a", "b", "c"},
    "since=2026-11-21T09:00:00Z": {"a", "b", "c"},
    "since=2026-11-21T09:00:00.001Z": set(),
    "until=2026-11-21T09:00:00Z": set(),
    "until=2026-11-21T09:00:00.001Z": {"a", "b", "c"},
    "since=2026-11-21T10:00:00%2B01:00": {"a", "b", "c"},
    "since=2026-11-21T10:00:01+01:00": set(),
    "since=2026-11&until=2026-12": {"a", "b", "c"},
}


async def test_lists_are_filtered(bench: Bench) -> None:
    store = bench.application.store
    for run in (a_run("a", RunState.FINISHED), a_run("b"), a_run("c", RunState.FAILED)):
        kind = "verify" if run.id == "b" else run.kind
        await store.save_run(type(run)(**{**vars(run), "kind": kind}))
    for query, expected in FILTERS.items():
        found = (await bench.client.get(f"/runs?{query}")).json()
        assert {run["id"] for run in found["runs"]} == expected, query
    first = (await bench.client.get("/runs?kind=calibration&limit=1")).json()
    assert [run["id"] for run in first["runs"]] == ["c"]
    assert [run["id"] for run in (await bench.client.get(first["next"])).json()["runs"]] == ["a"]
    for impossible in ("yesterday", "2026-13-45", "2026-02-30", "2026-11-21T25:00:00Z", "0001-01-01T00:00%2B05:00"):
        refused = await bench.client.get(f"/runs?since={impossible}")
        assert refused.status_code == 422 and "write 2026-11-21, or" in refused.json()["fix"], refused.text
    assert (await bench.client.get("/runs?kind=dance")).status_code == 422
    for name in ("Door 4711", "door 12", "window"):
        await bench.client.post("/scans", json={"name": name})
    scans = (await bench.client.get("/scans?name=DOOR&limit=1")).json()
    assert scans["scans"][0]["name"] == "door 12"
    assert (await bench.client.get(scans["next"])).json()["scans"][0]["name"] == "Door 4711"


async def test_calibrations_are_filtered_by_their_verdict(bench: Bench) -> None:
    await apply_calibration(bench, "good")
    for accepted, expected in (("true", 1), ("false", 0)):
        found = (await bench.client.get(f"/calibrations?accepted={accepted}")).json()["calibrations"]
        assert len(found) == expected


async def test_settings_as_loaded_hide_secrets_and_mark_what_was_given(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, camera={"address": "http://ann:sesame@camera/f.png"})) as bench:
        document = (await bench.client.get("/settings")).json()
        assert "sesame" not in str(document)
        assert document["settings"]["drift"]["learn"] == 5
        assert "drift" not in document["given"]
        assert document["given"]["target"]["columns"] == 11
        about = (await bench.client.get("/about")).json()
        assert "numpy" in {package["name"] for package in about["packages"]}


async def test_the_audit_log_says_whether_it_is_whole(bench: Bench) -> None:
    await bench.client.post("/scans")
    rows = (await bench.client.get("/audit")).json()["rows"]
    found = (await bench.client.get("/audit/verified")).json()
    assert (found["whole"], found["rows"], found["flaws"]) == (True, len(rows), [])
    assert found["last"] == {"sequence": rows[0]["sequence"], "hash": rows[0]["hash"]}


async def test_every_code_of_an_answer_has_its_help(bench: Bench) -> None:
    codes = {entry["code"]: entry for entry in (await bench.client.get("/help")).json()["help"]}
    for path in ("/runs/nowhere", "/nowhere"):
        code = (await bench.client.get(path)).json()["code"]
        assert codes[code]["status"] == 404
        assert (await bench.client.get(f"/help/{code}")).json() == codes[code]
    for code in ("run-in-progress", "link-lost", "point-uncertain", "key-missing", "stop-unconfirmed"):
        assert codes[code]["what"]
    assert (await bench.client.get("/help/nonsense")).status_code == 404


async def test_charts_of_earlier_calibrations_stay(bench: Bench) -> None:
    await apply_calibration(bench, "first")
    await apply_calibration(bench, "second")
    chart = (await bench.client.get("/drift", params={"calibration": "first"})).json()
    assert (chart["calibration_id"], chart["standing"]) == ("first", "learning")
    assert (await bench.client.get("/drift")).json()["calibration_id"] == "second"
    assert (await bench.client.get("/drift", params={"calibration": "nowhere"})).status_code == 404


async def test_who_applied_against_a_verdict_gives_a_reason(bench: Bench) -> None:
    from daemon.model.records import CalibrationRecord

    document = a_calibration("bad", accepted=False)
    await bench.application.store.save_calibration(CalibrationRecord("bad", None, document.created_at, False, document))
    body = {"applied_by": "Ann", "despite_verdict": True, "reason": "a trial without a part"}
    applied = (await bench.client.post("/calibrations/bad/apply", json=body)).json()
    assert (applied["role"], applied["despite_verdict"], applied["reason"]) == ("admin", True, body["reason"])
    assert (await bench.client.get("/calibrations/current")).json()["applied"] == applied
    row = (await bench.client.get("/audit")).json()["rows"][0]
    assert row["detail"]["reason"] == body["reason"]


async def next_event(bench: Bench, kind: str, act: Any) -> dict[str, Any]:
    events = bench.application.events
    await events.flush()
    after = events.last
    await act
    async with asyncio.timeout(LIMIT_S):
        async for event in events.listen(after):
            if event is not None and event.kind == kind:
                return event.data
    raise AssertionError(kind)


async def test_what_changes_is_an_event(bench: Bench) -> None:
    made = await next_event(bench, "calibration", apply_calibration(bench, "first"))
    assert made["calibration_id"] == "first"
    applied = await next_event(bench, "applied", bench.client.post("/calibrations/first/apply"))
    assert (applied["calibration_id"], applied["role"]) == ("first", "admin")
    key = await next_event(bench, "key", bench.client.post("/keys", json={"name": "MES", "role": "viewer"}))
    assert key["action"] == "added"


@pytest.mark.parametrize("path", ["/acceptances", "/acceptances/nowhere"])
async def test_there_are_no_acceptances_yet(bench: Bench, path: str) -> None:
    answer = await bench.client.get(path)
    assert answer.status_code == (200 if path == "/acceptances" else 404)
