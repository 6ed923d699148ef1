"""What the gateway shows of a cell, from what its daemon said last."""

import math
from typing import Any

import pytest

from gateways.opcua.cell_state import SCALARS, CellState

READY = {"calibrate": {"ready": True, "reasons": []}, "warnings": [], "warning_details": []}
MOTORS_OFF = {**READY, "calibrate": {"ready": False, "reasons": ["robot: motors are off"]}}
RUN = {"id": "r1", "kind": "verify", "station": 2, "stations": 3}


def state(heard: dict[str, Any] | None = None, **known: Any) -> CellState:
    there = CellState(**known)
    return there if heard is None else there.after(heard)


@pytest.mark.parametrize(
    ("shown", "outer", "inner", "ready", "reason"),
    [
        (state(), "Preoperational", "Initialized", False, "the daemon does not answer"),
        (state({"ready": READY}), "Operational", "Ready", True, ""),
        (state({"ready": MOTORS_OFF}), "Operational", "Initialized", False, "robot: motors are off"),
        (state({"ready": READY, "run": RUN}), "Operational", "SingleExecution", False, ""),
        (state({"ready": READY}, stop_unconfirmed=True), "Error", "Ready", True, ""),
        (state({"ready": READY}, store_sound=False), "Error", "Ready", True, ""),
        (state({"ready": None}), "Operational", "Initialized", False, ""),
    ],
)
def test_states_follow_the_daemon(shown: CellState, outer: str, inner: str, ready: bool, reason: str) -> None:
    assert shown.vision_state() == (outer, inner)
    assert (shown.ready, shown.reason) == (ready, reason)


def test_a_message_replaces_only_what_it_names() -> None:
    after = state({"ready": READY, "run": RUN}).after({"at": "later"})
    assert (after.run, after.live["at"]) == (RUN, "later")
    assert after.after({"run": None}).vision_state() == ("Operational", "Ready")


def test_every_scalar_has_a_value_of_its_type_even_when_nothing_is_known() -> None:
    types = {"Boolean": bool, "String": str, "Int32": int, "Double": float}
    for shown in (state(), state({"ready": READY, "run": RUN, "robot": None})):
        values = shown.scalars()
        assert list(values) == list(SCALARS)
        assert {name for name, (kind, _) in SCALARS.items() if type(values[name]) is not types[kind]} == set()
    assert math.isnan(state().scalars()["U_Mm"])


def test_what_needs_attention_is_a_condition_once() -> None:
    warned = {
        **READY,
        "warnings": ["verify again", "the arm may be armed", "the arm may be armed"],
        "warning_details": [{"id": "drift-due"}, {"id": "stop-unconfirmed-both"}, {"id": "stop-unconfirmed-both"}],
    }
    devices = [{"name": "camera", "connected": False}, {"name": "robot", "connected": True}]
    shown = state({"ready": warned, "devices": devices}, store_sound=False)
    assert {code: error for code, (_, error) in shown.conditions.items()} == {
        "drift-due": False,
        "stop-unconfirmed-both": True,
        "device-camera": False,
        "store-unsound": True,
    }
    assert list(state().conditions) == ["daemon-away"]
