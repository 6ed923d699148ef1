"""The sum as the RAPID computes it, on the published frames and on any others."""

from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mock_robot.rapid.scope import Slot
from mock_robot.rapid.values import RawBytes
from protocols.cb.frames import fletcher16
from tests.mock_robot.rapid.snippets import Snippet

COMM = Path(__file__).parents[3] / "deploy" / "rapid" / "CELL_comm.mod"


@cache
def module_with_the_sum() -> Snippet:
    text = COMM.read_text("ascii")
    function = text[text.index("  FUNC num cell_fletcher") : text.index("  FUNC num cell_length_of")]
    return Snippet(
        f"MODULE x\nPERS num result := 0;\nVAR rawbytes frame;\n{function}\nPROC main()\n"
        "result := cell_fletcher(frame, RawBytesLen(frame));\nENDPROC\nENDMODULE"
    )


def sum_of(frame: bytes) -> float:
    snippet = module_with_the_sum()
    frame_slot = snippet.program.scope.find("frame").slot
    assert isinstance(frame_slot, Slot)
    frame_slot.value = RawBytes(frame)
    return float(snippet.runs()["result"])


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        ("43 42 01 01 01 00 00 00 00 00 88 0a", 0x0A88),
        ("43 42 01 02 02 00 00 00 08 00 94 c7 01 00 00 00 01 00 00 00", 0xC794),
    ],
)
def test_the_published_sums_come_out_of_the_rapid(frame: str, expected: int) -> None:
    assert sum_of(bytes.fromhex(frame)) == expected


@settings(deadline=None)
@given(st.binary(min_size=12, max_size=1024))
def test_any_other_sum_too(frame: bytes) -> None:
    assert sum_of(frame) == fletcher16(frame[:10] + frame[12:])


@pytest.mark.parametrize("byte", [0, 1, 254, 255])
def test_the_longest_frame_keeps_every_partial_sum_exact(byte: int) -> None:
    frame = bytes([byte]) * 1024
    assert sum_of(frame) == fletcher16(frame[:10] + frame[12:])
