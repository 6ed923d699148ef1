"""Modbus as bytes: every request and its answer beside literal bytes, headers however cut, numbers in registers."""

import struct
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocols.modbus.bank import Identification, respond
from protocols.modbus.codes import ExceptionCode, Function
from protocols.modbus.errors import HeaderBroken, ModbusException
from protocols.modbus.mbap import Adu, MbapReader
from protocols.modbus.words import (
    WordOrder,
    crc16,
    float_words,
    integer_words,
    text_of,
    text_words,
    unsigned_of,
    unsigned_words,
)
from tests.support.registers import float_of, integer_of

ID = Identification("v", "p", "1.0", name="cell")


class Memory:
    """Ten registers that hold 100 + address, bits that are their address's lowest; 8 and 9 are read only."""

    def __init__(self) -> None:
        self.held = [100 + address for address in range(10)]
        self.coils = [bool(address % 2) for address in range(10)]

    def words(self, function: Function, address: int, count: int) -> Sequence[int]:
        self._inside(address, count, 10)
        return self.held[address : address + count]

    def bits(self, function: Function, address: int, count: int) -> Sequence[bool]:
        self._inside(address, count, 10)
        return self.coils[address : address + count]

    def write_words(self, address: int, values: Sequence[int]) -> None:
        self._inside(address, len(values), 8)
        self.held[address : address + len(values)] = values

    def write_bits(self, address: int, values: Sequence[bool]) -> None:
        self._inside(address, len(values), 8)
        self.coils[address : address + len(values)] = values

    def _inside(self, address: int, count: int, size: int) -> None:
        if address + count > size:
            raise ModbusException(ExceptionCode.ILLEGAL_DATA_ADDRESS, "outside")


ANSWERS = {
    "read coils": ("01 0000 0003", "01 01 02"),
    "read ten discrete inputs": ("02 0000 000a", "02 02 aa 02"),
    "read holding": ("03 0002 0002", "03 04 0066 0067"),
    "read input": ("04 0009 0001", "04 02 006d"),
    "write coil on": ("05 0002 ff00", "05 0002 ff00"),
    "write coil off": ("05 0001 0000", "05 0001 0000"),
    "write register": ("06 0003 abcd", "06 0003 abcd"),
    "write coils": ("0f 0000 0003 01 05", "0f 0000 0003"),
    "write registers": ("10 0001 0002 04 0001 0002", "10 0001 0002"),
    "mask write": ("16 0004 00f2 0025", "16 0004 00f2 0025"),
    "read write": ("17 0000 0002 0001 0001 02 0007", "17 04 0064 0007"),
    "identify, basic": ("2b 0e 01 00", "2b 0e 01 82 00 00 03 00 01 76 01 01 70 02 03 31 2e 30"),
    "identify, one": ("2b 0e 04 04", "2b 0e 04 82 00 00 01 04 04 63 65 6c 6c"),
    "identify from an object that is not there": (
        "2b 0e 01 09", "2b 0e 01 82 00 00 03 00 01 76 01 01 70 02 03 31 2e 30",
    ),
    # refusals
    "nothing": ("", "80 01"),
    "unknown function": ("07", "87 01"),
    "no registers": ("03 0000 0000", "83 03"),
    "126 registers": ("03 0000 007e", "83 03"),
    "2001 coils": ("01 0000 07d1", "81 03"),
    "beyond the end": ("03 0009 0002", "83 02"),
    "at the top of all addresses": ("04 ffff 0001", "84 02"),
    "coil of 1234": ("05 0000 1234", "85 03"),
    "write beyond": ("06 0008 0001", "86 02"),
    "write coils beyond": ("0f 0006 0003 01 05", "8f 02"),
    "write with a wrong byte count": ("10 0001 0002 03 0001 0002", "90 03"),
    "write with bytes missing": ("10 0001 0002 04 0001 00", "90 03"),
    "write with bytes too many": ("10 0001 0001 02 0001 00", "90 03"),
    "write 124": ("10 0000 007c f8" + "00" * 248, "90 03"),
    "read and nothing more": ("03", "83 03"),
    "read write, the read outside": ("17 0009 0002 0001 0001 02 0007", "97 02"),
    "read write, the write outside": ("17 0000 0002 0008 0001 02 0007", "97 02"),
    "other encapsulation": ("2b 0d 01 00", "ab 01"),
    "identify at level 5": ("2b 0e 05 00", "ab 03"),
    "identify one that is not there": ("2b 0e 04 63", "ab 02"),
}  # fmt: skip


@pytest.mark.parametrize(("request_hex", "answer_hex"), ANSWERS.values(), ids=ANSWERS.keys())
def test_every_request_has_its_answer(request_hex: str, answer_hex: str) -> None:
    assert respond(bytes.fromhex(request_hex), Memory(), ID).hex() == answer_hex.replace(" ", "")


def test_what_is_written_can_be_read() -> None:
    memory = Memory()
    for write in (
        "05 0002 ff00",
        "0f 0003 0002 01 01",
        "06 0000 1111",
        "10 0001 0002 04 2222 3333",
        "16 0004 00f2 0025",
    ):
        respond(bytes.fromhex(write), memory, ID)
    assert memory.coils[2:5] == [True, True, False]
    assert memory.held[:3] == [0x1111, 0x2222, 0x3333]
    assert memory.held[4] == (104 & 0xF2) | (0x25 & ~0xF2)


def test_a_read_write_that_cannot_be_read_writes_nothing() -> None:
    memory = Memory()
    respond(bytes.fromhex("17 0009 0002 0001 0001 02 0007"), memory, ID)
    assert memory.held[1] == 101


@given(st.binary(max_size=260))
def test_any_bytes_get_an_answer_with_their_own_function(pdu: bytes) -> None:
    answer = respond(pdu, Memory(), ID)
    assert 2 <= len(answer) <= 253
    assert answer[0] & 0x7F == (pdu[0] if pdu else 0) & 0x7F


ADU = st.builds(Adu, st.integers(0, 65535), st.integers(0, 255), st.binary(min_size=1, max_size=253))


@given(st.lists(ADU, max_size=8), st.data())
def test_frames_come_whole_however_they_are_cut(adus: list[Adu], data: st.DataObject) -> None:
    stream = b"".join(adu.encode() for adu in adus)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    reader = MbapReader()
    found = [adu for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True) for adu in reader.feed(stream[a:b])]
    assert found == adus
    assert reader.half_frame_bytes == 0


@pytest.mark.parametrize(
    ("header", "word"),
    [("0001 0001", "protocol identifier"), ("0001 00ff", "protocol"), ("0001 01", "protocol"),
     ("0001 0000 0001", "length of 1"), ("0001 0000 0000", "length of 0"), ("0001 0000 00ff", "length of 255"),
     ("0001 0000 ffff", "length of 65535")],
)  # fmt: skip
def test_a_header_that_is_none_breaks_the_stream_behind_the_frames_before_it(header: str, word: str) -> None:
    good = Adu(7, 1, b"\x03\0\0\0\1")
    reader, found = MbapReader(), []
    with pytest.raises(HeaderBroken, match=word):
        found.extend(_each(reader, good.encode() + bytes.fromhex(header), found))
    assert found == [good]
    with pytest.raises(HeaderBroken):
        list(reader.feed(good.encode()))


def _each(reader: MbapReader, data: bytes, found: list[Adu]) -> list[Adu]:
    for adu in reader.feed(data):
        found.append(adu)
    return []


HIGH, LOW = WordOrder.HIGH_FIRST, WordOrder.LOW_FIRST


def test_the_known_constant_in_both_orders() -> None:
    assert float_words(123.456, HIGH) == (0x42F6, 0xE979)
    assert float_words(123.456, LOW) == (0xE979, 0x42F6)
    assert integer_words(-2, HIGH) == (0xFFFF, 0xFFFE)


@given(st.sampled_from(WordOrder), st.integers(-(2**31), 2**31 - 1), st.floats(width=32, allow_nan=False))
def test_numbers_come_back(order: WordOrder, integer: int, real: float) -> None:
    assert integer_of(integer_words(integer, order), order) == integer
    assert unsigned_of(unsigned_words(abs(integer), order), order) == abs(integer)
    assert float_of(float_words(real, order), order) == max(min(real, 3.4028234663852886e38), -3.4028234663852886e38)


@given(st.integers(), st.floats(allow_nan=False))
def test_numbers_out_of_range_are_held_at_the_limit(integer: int, real: float) -> None:
    assert -(2**31) <= integer_of(integer_words(integer, HIGH), HIGH) <= 2**31 - 1
    assert 0 <= unsigned_of(unsigned_words(integer, HIGH), HIGH) < 2**32
    assert abs(float_of(float_words(real, HIGH), HIGH)) <= 3.41e38


def test_text_is_cut_and_filled() -> None:
    assert text_of(text_words("20261121-090000-3f9a1c", 12)) == "20261121-090000-3f9a1c"
    assert text_words("abc", 3) == (0x6162, 0x6300, 0)
    assert text_of(text_words("ümlaut and more", 4)) == "?mlaut a"


def test_the_crc_is_modbus() -> None:
    """The check value of the catalogue of CRCs: 4b37 for the digits 1 to 9; and a number of bytes that is even."""
    assert crc16(struct.unpack(">4H", b"12345678")) == 0x37DD
    assert crc16([]) == 0xFFFF


@settings(max_examples=50)
@given(st.lists(st.integers(0, 65535), min_size=1, max_size=80), st.data())
def test_the_crc_detects_a_flipped_bit(words: list[int], data: st.DataObject) -> None:
    place, bit = data.draw(st.integers(0, len(words) - 1)), data.draw(st.integers(0, 15))
    other = [*words]
    other[place] ^= 1 << bit
    assert crc16(other) != crc16(words)
