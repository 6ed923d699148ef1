"""The mock's web services are as strict as a controller's: who breaks a rule gets the controller's answer."""

import re
from collections.abc import Iterator

import httpx
import pytest

from mock_robot.cabinet.panel import Mode
from mock_robot.rws.mastership import POLL_LIMIT_S
from mock_robot.rws.sessions import BURST, IDLE_S, MAX_SESSIONS, Session, Sessions, SessionsExhausted
from tests.mock_robot.rws_cell import FORM_2, RwsCell, rws_cell_apart
from tests.support.waiting import LIMIT_S

START = {"regain": "continue", "execmode": "continue", "cycle": "once", "condition": "none", "stopatbp": "disabled",
         "alltaskbytsp": "false"}  # fmt: skip
START_1, START_2 = "/rw/rapid/execution?action=start", "/rw/rapid/execution/start"


@pytest.fixture
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart() as running:
        yield running


def code_1(answer: httpx.Response) -> tuple[int, int]:
    """HTTP's status and ABB's code, of an error in JSON of 1.0."""
    status = answer.json()["_embedded"]["status"]
    assert status["msg"].endswith(f"code:{status['code']} icode:-1")
    return answer.status_code, status["code"]


def code_2(answer: httpx.Response) -> tuple[int, int]:
    assert answer.headers["content-type"] == "application/hal+json;v=2.0"
    return answer.status_code, answer.json()["status"]["code"]


# --- who may come in ---


def test_rws_1_wants_a_digest_and_then_lives_on_its_cookies(cell: RwsCell) -> None:
    with httpx.Client(base_url=cell.first, timeout=LIMIT_S) as stranger:
        challenge = stranger.get("/rw/panel/ctrlstate")
        assert challenge.status_code == 401
        assert 'realm="validusers@robapi.abb"' in challenge.headers["www-authenticate"]
        assert 'qop="auth"' in challenge.headers["www-authenticate"]
    with cell.client_1() as client:
        assert client.get("/rw/panel/ctrlstate", params={"json": "1"}).json()["_embedded"]["_state"][0] == {
            "_type": "pnl-ctrlstate", "_title": "ctrlstate", "ctrlstate": "motoron"}  # fmt: skip
        assert {"-http-session-", "ABBCX"} <= set(client.cookies)
        assert client.get("/rw/panel/opmode", auth=None).status_code == 200
        assert cell.cell.rws.first.sessions.count == 1
    with cell.client_1(password="guess") as liar:
        assert liar.get("/rw/panel/ctrlstate").status_code == 401
    with httpx.Client(base_url=cell.first, auth=("Default User", "robotics"), timeout=LIMIT_S) as basic:
        assert basic.get("/rw/panel/ctrlstate").status_code == 401


def test_a_digest_is_not_compared_with_the_target_but_with_what_it_says(cell: RwsCell) -> None:
    """requests drops `;value` from the uri that it signs; a controller does not mind."""
    with cell.client_1() as client:
        answer = client.get("/rw/rapid/symbol/data/RAPID/T_ROB1/user/reg1;value?json=1")
        assert answer.json()["_embedded"]["_state"][0]["value"] == "0"


def test_the_two_versions_write_xhtml_and_json_as_each_does(cell: RwsCell) -> None:
    with cell.client_1() as client:
        plain = client.get("/rw/panel/ctrlstate/")
        assert plain.headers["content-type"] == "application/xhtml+xml"
        assert '<li class="pnl-ctrlstate" title="ctrlstate"><span class="ctrlstate">motoron</span></li>' in plain.text
        twice = client.get("/rw/panel/opmode?json=1&json=1")
        assert twice.headers["content-type"] == "application/json"
        wrong = client.get("/rw/nothing")
        assert wrong.status_code == 404
        assert '<span class="code">-1073414146</span>' in wrong.text
    with cell.client_2() as client:
        document = client.get("/rw/panel/ctrl-state").json()
        assert document["status"] == {"code": 294912}
        assert document["state"][0]["ctrlstate"] == "motoron"
        listed = client.get("/rw/rapid/tasks").json()["_embedded"]["resources"]
        assert [task["_title"] for task in listed] == [
            "spy",
            "program-pointer",
            "motion-pointer",
            "T_ROB1",
            "T_HANDEYED",
        ]
        assert client.get("/rw/panel/ctrlstate").status_code == 404  # the name of 1.0
        xhtml = client.get("/rw/panel/opmode", headers={"Accept": "application/xhtml+xml;v=2.0"})
        assert '<span class="opmode">AUTO</span>' in xhtml.text


@pytest.mark.parametrize("accept", ["application/json", "application/hal+json", "text/html", "application/xhtml+xml"])
def test_rws_2_wants_its_version_in_accept(cell: RwsCell, accept: str) -> None:
    with cell.client_2() as client:
        answer = client.get("/rw/panel/ctrl-state", headers={"Accept": accept})
        assert answer.status_code == 406
        assert client.get("/rw/panel/ctrl-state").status_code == 200


@pytest.mark.parametrize("content_type", [None, "application/x-www-form-urlencoded", "application/json;v=2.0"])
def test_rws_2_wants_its_version_in_the_content_type_of_every_post_even_an_empty_one(
    cell: RwsCell, content_type: str | None
) -> None:
    with cell.client_2() as client:
        headers = {"Content-Type": content_type} if content_type else {}
        assert client.post("/rw/mastership/request", headers=headers).status_code == 415
        assert client.post("/rw/mastership/request", headers=FORM_2).status_code == 204


def test_rws_2_wants_basic_and_the_right_password(cell: RwsCell) -> None:
    with cell.client_2(password="guess") as liar:
        answer = liar.get("/rw/panel/ctrl-state")
        assert answer.status_code == 401
        assert answer.headers["www-authenticate"].startswith("Basic")


def test_a_client_that_loses_its_cookies_takes_every_session_and_then_gets_503(cell: RwsCell) -> None:
    with httpx.Client(verify=False, timeout=LIMIT_S) as forgetful:
        answers = []
        for _ in range(MAX_SESSIONS + 1):
            forgetful.cookies.clear()
            url = f"{cell.second}/rw/panel/ctrl-state"
            answers.append(forgetful.get(url, auth=("Admin", "robotics"), headers=FORM_2).status_code)
    assert answers == [200] * MAX_SESSIONS + [503]


def test_idle_sessions_die_after_five_minutes_and_a_logout_frees_one_at_once(cell: RwsCell) -> None:
    ended: list[Session] = []
    sessions = Sessions(ended.append)
    for _ in range(MAX_SESSIONS):
        sessions.open("u", 0.0)
    with pytest.raises(SessionsExhausted):
        sessions.open("u", IDLE_S - 1)
    assert sessions.open("u", IDLE_S + 1).user == "u"
    assert len(ended) == MAX_SESSIONS
    with cell.client_1() as client:
        client.get("/rw/system")
        client.get("/logout")
        assert cell.cell.rws.first.sessions.count == 0


def test_more_than_twenty_requests_a_second_are_slowed_down_and_then_refused() -> None:
    sessions = Sessions(lambda session: None)
    session = sessions.open("u", 0.0)
    waits = [sessions.wait_s(session, 0.0) for _ in range(int(BURST) + 10)]
    assert waits[: int(BURST)] == [0.0] * int(BURST)
    assert waits[-1] == pytest.approx(0.5)
    with pytest.raises(SessionsExhausted):
        for _ in range(20):
            sessions.wait_s(session, 0.0)
    assert sessions.wait_s(session, 5.0) == 0.0


# --- what may be done in which state ---


def test_rws_1_takes_free_mastership_for_a_request_and_respects_another_holder(cell: RwsCell) -> None:
    with cell.client_1() as holder, cell.client_1() as other:
        other.get("/rw/system")
        set_reg1 = "/rw/rapid/symbol/data/RAPID/T_ROB1/user/reg1?action=set&json=1"
        assert holder.post(set_reg1, data={"value": "1"}).status_code == 204
        assert holder.post("/rw/mastership/rapid?action=request").status_code == 204
        assert code_1(other.post(set_reg1, data={"value": "2"})) == (403, -1073445862)
        assert code_1(other.post("/rw/mastership?action=request&json=1")) == (403, -1073445862)
        assert code_1(other.post("/rw/mastership/rapid?action=release&json=1")) == (403, -1073445862)
        holder.get("/logout")
        assert other.post(set_reg1, data={"value": "2"}).status_code == 204
        assert code_1(other.post("/rw/mastership?json=1")) == (400, -1073445879)  # rwsuis forgets the action


def test_rws_2_wants_mastership_in_so_many_words(cell: RwsCell) -> None:
    with cell.client_2() as client:
        data = "/rw/rapid/symbol/RAPID/T_ROB1/user/reg1/data"
        assert code_2(client.post(data, data={"value": "1"}, headers=FORM_2)) == (403, -1073445859)
        speed = "/rw/panel/speedratio?action=setspeedratio"
        assert code_2(client.post(speed, data={"speed-ratio": "50"}, headers=FORM_2)) == (403, -1073445859)
        assert client.post("/rw/mastership/edit/request", headers=FORM_2).status_code == 204
        assert client.post(data, data={"value": "1"}, headers=FORM_2).status_code == 204
        assert client.post(speed, data={"speed-ratio": "50"}, headers=FORM_2).status_code == 204
        assert cell.controller.panel.speed_override == 0.5
        assert client.post("/rw/mastership/edit/release", headers=FORM_2).status_code == 204
        assert client.post("/rw/mastership/rapid/request", headers=FORM_2).status_code == 404  # a domain of 1.0


def test_start_needs_motors_a_stopped_program_every_field_and_in_2_mastership(cell: RwsCell) -> None:
    with cell.client_1() as client:
        assert code_1(client.post(f"{START_1}&json=1", data=START)) == (400, -1073442809)  # it runs already
        assert client.post("/rw/rapid/execution?action=stop", data={"stopmode": "stop"}).status_code == 204
        assert cell.world.execution_state == "stopped"
        assert code_1(client.post(f"{START_1}&json=1", data={"cycle": "once"})) == (400, -1073445879)
        cell.does(lambda: cell.controller.switch_motors(False, cell.cell.clock()))
        assert code_1(client.post(f"{START_1}&json=1", data=START)) == (400, -1073442809)
        assert client.post("/rw/panel/ctrlstate?action=setctrlstate", data={"ctrl-state": "motoron"}).status_code == 204
    with cell.client_2() as client:
        assert code_2(client.post(START_2, data=START, headers=FORM_2)) == (403, -1073445859)
        assert client.post(f"{START_2}?mastership=implicit", data=START, headers=FORM_2).status_code == 204
        assert cell.world.execution_state == "running"
        assert client.post("/rw/rapid/execution/stop", headers=FORM_2).status_code == 204  # stop needs nothing
        assert cell.world.execution_state == "stopped"


def test_the_emergency_stop_is_seen_and_motors_come_back_only_after_its_release(cell: RwsCell) -> None:
    with cell.client_1() as client:

        def state() -> str:
            document = client.get("/rw/panel/ctrlstate?json=1").json()
            return str(document["_embedded"]["_state"][0]["ctrlstate"])

        motors_on = "/rw/panel/ctrlstate?action=setctrlstate&json=1"
        cell.does(lambda: cell.controller.press_emergency_stop(True, cell.cell.clock()))
        assert state() == "emergencystop"
        assert code_1(client.post(motors_on, data={"ctrl-state": "motoron"})) == (400, -1073442809)
        cell.does(lambda: cell.controller.press_emergency_stop(False, cell.cell.clock()))
        assert state() == "emergencystopreset"
        assert client.post(motors_on, data={"ctrl-state": "motoron"}).status_code == 204
        assert state() == "motoron"
        assert code_1(client.post(motors_on, data={"ctrl-state": "on"})) == (400, -1073445879)


def test_in_manual_mode_nothing_is_written_without_the_operators_consent(cell: RwsCell) -> None:
    cell.does(lambda: cell.controller.switch_mode(Mode.MANR, cell.cell.clock()))
    set_reg1 = "/rw/rapid/symbol/data/RAPID/T_ROB1/user/reg1?action=set&json=1"
    with cell.client_1() as client:
        assert code_1(client.post(set_reg1, data={"value": "1"})) == (403, -1073445881)
        assert code_1(client.post("/rw/mastership?action=request&json=1")) == (403, -1073445881)
        motors = client.post("/rw/panel/ctrlstate?action=setctrlstate&json=1", data={"ctrl-state": "motoron"})
        assert code_1(motors) == (403, -1073445881)
        asked = client.post("/users/rmmp?json=1", data={"privilege": "modify"})
        assert (asked.status_code, asked.headers["content-type"]) == (202, "application/json")
        assert client.get("/users/rmmp/poll?json=1").json()["_embedded"]["_state"][0]["status"] == "PENDING"
        cell.world.mastership.operator_says = True
        assert client.get("/users/rmmp/poll?json=1").json()["_embedded"]["_state"][0]["status"] == "GRANTED"
        assert client.post(set_reg1, data={"value": "1"}).status_code == 204
        assert POLL_LIMIT_S == 10.0


def test_a_signal_is_written_only_when_its_access_level_allows(cell: RwsCell) -> None:
    with cell.client_1() as client:
        base = "/rw/iosystem/signals"
        assert client.post(f"{base}/Local/DRV_1/do_spare?action=set", data={"lvalue": "1"}).status_code == 204
        assert cell.world.memory.signals["do_spare"].value == 1
        for rejected in ("Local/DRV_1/di_part", "cell_do_motors"):
            answer = client.post(f"{base}/{rejected}?action=set&json=1", data={"lvalue": "1"})
            assert code_1(answer) == (403, -1073445881)
        assert code_1(client.get(f"{base}/NoNet/NoDev/NoSignal?json=1")) == (404, -1073445866)
    with cell.client_2() as client:
        assert client.get("/rw/iosystem/signals/cell_do_motors").json()["state"][0]["lvalue"] == "1"


def test_names_that_do_not_exist_get_the_codes_of_each_version(cell: RwsCell) -> None:
    with cell.client_1() as client:
        assert code_1(client.get("/rw/rapid/symbol/data/RAPID/T_ROB1/NoMod/no?json=1")) == (400, -1073414146)
        assert code_1(client.get("/rw/rapid/tasks/T_ROB1/modules/No?json=1")) == (404, -1073414146)
        assert code_1(client.get("/rw/motionsystem/mechunits/ROB_9/robtarget?json=1")) == (404, -1073414146)
        assert client.get("/fileservice/$HOME/no.mod").status_code == 404
    with cell.client_2() as client:
        assert code_2(client.get("/rw/rapid/symbol/RAPID/T_ROB1/NoMod/no/data")) == (404, -1073442816)
        assert code_2(client.get("/rw/rapid/tasks/T_ROB1/modules/No")) == (400, -1073442813)
        assert code_2(client.get("/fileservice/HOME/no.modx")) == (404, -1073438713)
        assert code_2(client.get("/fileservice/NOVOL:/x")) == (400, -1073438716)


def test_modules_are_loaded_from_files_into_a_stopped_program(cell: RwsCell) -> None:
    load = "/rw/rapid/tasks/T_ROB1/loadmod"
    with cell.client_2() as client:
        client.post("/rw/mastership/request", headers=FORM_2)
        form = {"modulepath": "HOME/cell/x.mod"}
        assert code_2(client.post(load, data=form, headers=FORM_2)) == (400, -1073438708)
        assert code_2(client.put("/fileservice/HOME/cell/x.mod", content=b"MODULE Mine")) == (404, -1073438713)
        make = "/fileservice/HOME/create"
        assert client.post(make, data={"fs-newname": "cell"}, headers=FORM_2).status_code == 204
        assert client.post(make, data={"fs-newname": "cell"}, headers=FORM_2).status_code == 409
        assert client.put("/fileservice/HOME/cell/x.mod", content=b"MODULE Mine\nENDMODULE").status_code == 201
        assert client.delete("/fileservice/HOME/cell/x.mod", headers={"Accept": "*/*"}).status_code == 406
        assert code_2(client.post(load, data=form, headers=FORM_2)) == (400, -1073442809)  # it runs
        client.post("/rw/rapid/execution/stop", headers=FORM_2)
        assert client.post(load, data=form, headers=FORM_2).status_code == 204
        assert code_2(client.post(load, data=form, headers=FORM_2)) == (400, -1073445879)  # loaded already
        assert client.post(load, data={**form, "replace": "true"}, headers=FORM_2).status_code == 204
        unload = "/rw/rapid/tasks/T_ROB1/unloadmod"
        assert client.post(unload, data={"module": "Mine"}, headers=FORM_2).status_code == 204
        assert code_2(client.post(unload, data={"module": "Mine"}, headers=FORM_2)) == (400, -1073442816)
    with cell.client_1() as client:
        assert client.get("/fileservice//HOME//cell/x.mod").content.startswith(b"MODULE")
        assert client.delete("/fileservice/$HOME/cell/x.mod").status_code == 204
        assert client.post("/fileservice/$HOME?fs-action=create", data={"fs-newname": "a"}).status_code == 400
        new = {"fs-action": "create", "fs-newname": "a"}
        assert client.post("/fileservice/$HOME", data=new).status_code == 201
        assert client.post("/fileservice/$HOME/none", data=new).status_code == 404


# --- one truth ---


def robtarget(client: httpx.Client, **query: str) -> dict[str, str]:
    answer = client.get("/rw/motionsystem/mechunits/ROB_1/robtarget", params=query).json()
    state = answer.get("state") or answer["_embedded"]["_state"]
    return dict(state[0])


def test_both_versions_give_the_same_pose_and_print_an_axis_that_is_not_there_each_in_its_way(cell: RwsCell) -> None:
    with cell.client_1() as first, cell.client_2() as second:
        one, two = robtarget(first, json="1"), robtarget(second)
    numbers = ("x", "y", "z", "q1", "q2", "q3", "q4", "cf1", "cf4", "cf6", "cfx")
    assert [one[name] for name in numbers] == [two[name] for name in numbers]
    assert one["eax_a"] == one["eaxa"] == "8.999999e+09"
    assert two["eax_a"] == "9000000000"


def test_without_tool_and_work_object_the_pose_is_of_what_is_selected_at_the_pendant(cell: RwsCell) -> None:
    with cell.client_1() as client:
        explicit = {"tool": "tool0", "wobj": "wobj0", "json": "1"}
        before = robtarget(client, json="1")
        assert before == robtarget(client, **explicit)
        cell.does(lambda: cell.cell.inject_fault("rws-other-tool"))
        assert robtarget(client, **explicit) == before
        assert robtarget(client, json="1")["z"] != before["z"]
        for coordinate in ("Base", "World", "Word", "Wobj"):
            assert robtarget(client, **explicit, coordinate=coordinate) == before
        assert client.get("/rw/motionsystem/mechunits/ROB_1/robtarget?tool=noTool&json=1").status_code == 400


def test_the_event_log_is_the_cabinets_numbered_newest_first(cell: RwsCell) -> None:
    cell.does(lambda: cell.controller.press_emergency_stop(True, cell.cell.clock()))
    cell.does(lambda: cell.controller.record(cell.cell.clock(), 50050, "position outside reach"))
    with cell.client_1() as client:
        entries = client.get("/rw/elog/0?lang=en&json=1").json()["_embedded"]["_state"]
    assert [(entry["code"], entry["msgtype"]) for entry in entries[:2]] == [("50050", "3"), ("10013", "1")]
    assert entries[0]["_title"] == "/rw/elog/0/3"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d T \d\d:\d\d:\d\d", entries[0]["tstamp"])


def test_rws_2_lists_the_event_log_oldest_first_and_newest_first_only_in_version_2_1(cell: RwsCell) -> None:
    for code in (50050, 50080):
        cell.does(lambda code=code: cell.controller.record(cell.cell.clock(), code, "refused"))  # type: ignore[misc]

    def codes(answer: httpx.Response) -> list[str]:
        return [entry["code"] for entry in answer.json()["_embedded"]["resources"]]

    with cell.client_2() as client:
        newest = {"Accept": "application/hal+json;v=2.1"}
        assert codes(client.get("/rw/elog/0?lang=en"))[-2:] == ["50050", "50080"]
        assert codes(client.get("/rw/elog/0?lang=en&order=lifo", headers=newest))[:2] == ["50080", "50050"]
        assert client.get("/rw/elog/0?lang=en&order=lifo").status_code == 400
        assert client.get("/rw/panel/opmode", headers=newest).status_code == 406
