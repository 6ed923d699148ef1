"""The pure half of the driver rws: addresses, answers taken apart, refusals in our words."""

import math
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import AddressNotUnderstood, DeviceUnreachable, GarbledAnswer, RequestRefused
from drivers.registry import ROBOTS, check_robot_address
from drivers.robots.abb.acceptance.subscription import events_in
from drivers.robots.abb.robtarget import UNUSED_AXIS
from drivers.robots.abb.rws import parsing
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.client import ControllerBusy, error_of_response
from drivers.robots.abb.rws.dialect import DIALECTS, error_in

ROBTARGET = {"x": "515", "y": "0", "z": "712", "q1": "0.707106769", "q2": "0", "q3": "0.707106769", "q4": "0",
             "cf1": "0", "cf4": "-1", "cf6": "0", "cfx": "1",
             **{f"eax_{axis}": "9E+09" for axis in "abcdef"}}  # fmt: skip


@pytest.mark.parametrize(
    ("address", "read"),
    [
        ("rws://192.168.125.1", RwsAddress("192.168.125.1")),
        ("rws://[::1]:8080", RwsAddress("::1", 8080)),
        ("rws://Admin:a%40b@h", RwsAddress("h", user="Admin", password="a@b")),
        ("rws://h?version=2&frame=base&mechunit=ROB_2", RwsAddress("h", version=2, frame="base", mechunit="ROB_2")),
        ("rws://h?certificate=/c.pem", RwsAddress("h", certificate=Path("/c.pem"))),
        ("rws://u@h?password_file=/run/p", RwsAddress("h", user="u", password_file=Path("/run/p"))),
    ],
)
def test_an_address_says_where_and_how_to_ask(address, read):
    assert ROBOTS["rws"][0](address) == read
    check_robot_address(address)


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("rws://", "the host is missing"),
        ("rws://h/rw", "a path"),
        ("rws://h?versions=2", "unknown option 'versions'"),
        ("rws://h?version=3", "version is 1 or 2"),
        ("rws://h?frame=tool", "frame is one of wobj, base, world"),
        ("rws://h?certificate=", "no value"),
        ("rws://h:99999", "rws://host"),
        ("rws://zelle ü", "Invalid IDNA hostname: 'zelle ü'"),
        (f"rws://{'h' * 70_000}", "too long"),
        ("rws://a..b", "label empty or too long"),
        ("rws://xn--abc", "rws://host"),
    ],
)
def test_an_address_that_means_nothing_says_what_would(address, message):
    with pytest.raises(AddressNotUnderstood, match=message.replace("?", r"\?")):
        check_robot_address(address)


def test_no_password_is_shown():
    with pytest.raises(AddressNotUnderstood) as misunderstood:
        check_robot_address("rws://Admin:hidden@h?x=1")
    assert "hidden" not in str(misunderstood.value)
    address = RwsAddress.parse("rws://Admin:hidden@h:81")
    assert "hidden" not in repr(address) + address.address + address.url(2)
    assert address.url(2) == "https://h:81"


def test_a_password_comes_from_its_file_and_a_missing_file_says_so(tmp_path):
    kept = tmp_path / "password"
    kept.write_text("hidden\n")
    assert RwsAddress("h", password_file=kept).secret("robot") == "hidden"
    with pytest.raises(RequestRefused, match="password_file"):
        RwsAddress("h", password_file=tmp_path / "none").secret("robot")


def test_a_robtarget_becomes_a_pose_scalar_first_in_millimetres():
    pose = parsing.pose("robot", ROBTARGET, 5.0)
    assert pose.base_T_flange[:3, 3].tolist() == [515.0, 0.0, 712.0]
    assert np.allclose(pose.base_T_flange[:3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-7)
    assert pose.posture == (0, -1, 0, 1)
    assert pose.external_axes == (UNUSED_AXIS,) * 6
    assert (pose.still, pose.taken_at_s) == (False, 5.0)


@pytest.mark.parametrize("spelled", ["eax_{}", "eax{}"])
@pytest.mark.parametrize("unused", ["9E+09", "8.999999e+09", "9000000000"])
def test_both_spellings_of_the_external_axes_are_read_and_every_print_of_9e9(spelled, unused):
    values = {name: value for name, value in ROBTARGET.items() if not name.startswith("eax")}
    values |= {spelled.format(axis): unused for axis in "bcdef"} | {spelled.format("a"): "12.5"}
    assert parsing.pose("robot", values, 0.0).external_axes == (12.5, *(UNUSED_AXIS,) * 5)


@pytest.mark.parametrize(
    "wrong",
    [{"x": "nan"}, {"q1": "0.5"}, {"q2": ""}, {"z": None}, {"cf1": "quarter"}, {"eax_b": "inf"}, {"y": ["1"]}],
)
def test_a_pose_that_is_none_is_an_error(wrong):
    with pytest.raises(GarbledAnswer):
        parsing.pose("robot", {**ROBTARGET, **wrong}, 0.0)


@pytest.mark.parametrize(
    ("shift_mm", "turn_deg", "still"),
    [(0.0, 0.0, True), (0.019, 0.0, True), (0.021, 0.0, False), (0.0, 0.0049, True), (0.0, 0.0051, False)],
)
def test_two_readings_that_agree_to_two_hundredths_are_of_an_arm_that_stands(shift_mm, turn_deg, still):
    half = math.radians(turn_deg) / 2
    turned = {"q1": "1", "q2": "0", "q3": "0", "q4": "0"}
    after = {**turned, "x": f"{515 + shift_mm:.6f}", "q1": f"{math.cos(half):.17g}", "q2": f"{math.sin(half):.17g}"}
    before = parsing.pose("robot", {**ROBTARGET, **turned}, 1.0)
    stood = parsing.with_standstill(before, parsing.pose("robot", {**ROBTARGET, **after}, 2.0))
    assert (stood.still, stood.taken_at_s) == (still, 2.0)


@pytest.mark.parametrize(
    ("controller", "mode", "run", "speed", "said"),
    [
        ("motoron", "AUTO", "running", 100.0, {"motors_on", "automatic", "program_running"}),
        ("motoron", "MANR", "stopped", 100.0, {"motors_on", "speed_limited"}),
        ("motoroff", "AUTO", "stopped", 50.0, {"automatic", "speed_limited"}),
        ("emergencystop", "AUTO", "stopped", 100.0, {"automatic", "emergency_stop"}),
        ("emergencystopreset", "AUTO", "stopped", 100.0, {"automatic", "emergency_stop"}),
        ("guardstop", "AUTO", "stopped", 100.0, {"automatic"}),
    ],
)
def test_the_panel_becomes_a_status_that_is_never_armed(controller, mode, run, speed, said):
    status = parsing.status(parsing.ControllerState(controller, mode, run, speed), False, 1.0)
    true = {name for name in vars(status) if getattr(status, name) is True}
    assert true == said | {"in_position"}


def test_answers_of_both_versions_are_taken_apart():
    first = b'{"_links":{},"_embedded":{"_state":[{"_type":"pnl-opmode","opmode":"AUTO"}]}}'
    second = b'{"_links":{},"status":{"code":294912},"state":[{"_type":"pnl-opmode","opmode":"AUTO"}]}'
    listed = b'{"_embedded":{"resources":[{"_title":"T_ROB1"}]}}'
    assert DIALECTS[1].page(first)[0][0]["opmode"] == DIALECTS[2].page(second)[0][0]["opmode"] == "AUTO"
    assert DIALECTS[2].page(listed) == ([{"_title": "T_ROB1"}], {})


def test_a_list_names_its_next_page_whichever_way_it_is_written():
    plain = b'{"_links":{"next":{"href":"EIO/EIO_SIGNAL/instances?start=70&limit=70"}},"_embedded":{"resources":[]}}'
    escaped = plain.replace(b"&", b"&amp;")
    assert DIALECTS[2].page(plain) == DIALECTS[2].page(escaped) == ([], {"start": "70", "limit": "70"})


def test_numbers_with_leading_zeros_are_read_and_texts_are_left_alone():
    numbers = b'[{"value":-01},{"value":007},{"value":0.5}]'
    log = b'{"_embedded":{"resources":[{"desc":"\\"at -01 s\\", 007","argv":' + numbers + b"}]}}"
    items, _ = DIALECTS[2].page(log)
    assert items == [{"desc": '"at -01 s", 007', "argv": [{"value": -1}, {"value": 7}, {"value": 0.5}]}]


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode) | st.sampled_from([b"[]", b"1", b'{"state":1}']))
def test_whatever_comes_is_items_or_a_value_error_and_never_anything_else(content):
    for dialect in DIALECTS.values():
        with suppress(ValueError):
            assert isinstance(dialect.page(content)[0], list)
    code, message = error_in(content)
    assert code is None or isinstance(code, int)
    assert isinstance(message, str)
    assert isinstance(events_in(content.decode("latin-1")), list)


@pytest.mark.parametrize(
    ("status", "body", "kind", "name"),
    [
        (403, b'{"status":{"code":-1073445862,"msg":"held code:-1073445862"}}', RequestRefused, "MASTERSHIP_HELD"),
        (403, b'{"_embedded":{"status":{"code":-1073445881,"msg":"x"},"_state":[]}}', RequestRefused, "REJECTED"),
        (404, b'<span class="code">-1073414146</span><span class="msg">no</span>', RequestRefused, "NOT_FOUND"),
        (401, b"", RequestRefused, "UNAUTHORIZED"),
        (406, b"<html>", RequestRefused, "NOT_ACCEPTABLE"),
        (410, b"", RequestRefused, "GONE"),
        (503, b"", ControllerBusy, None),
        (500, b"", DeviceUnreachable, None),
        (418, b"", GarbledAnswer, None),
        (302, b"", GarbledAnswer, None),
    ],
)
def test_a_refusal_is_reported_by_abbs_number_or_by_the_status(status, body, kind, name):
    error = error_of_response("robot", "reading", status, *error_in(body))
    assert type(error) is kind
    assert error.fix
    if name:
        assert error.status == name


def test_an_event_is_read_from_xhtml_with_its_entities():
    message = (
        '<ul><li class="pnl-ctrlstate-ev" title="ctrlstate"><a href="/rw/panel/ctrlstate" rel="self"/>'
        '<span class="ctrlstate">motoroff</span></li>'
        '<li class="rap-value-ev" title="a"><span class="value">&quot;&lt;x&gt;&quot;</span></li></ul>'
    )
    assert events_in(message) == [{"ctrlstate": "motoroff"}, {"value": '"<x>"'}]
