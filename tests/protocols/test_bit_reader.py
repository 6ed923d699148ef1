"""Questions whose answers cannot be mistaken for one another; under trouble on the line: test_line_answers.py."""

import pytest

from protocols.modbus.bit_reader import AnswerKind, Bit, BitReader
from protocols.modbus.codes import Function
from tests.protocols.line_trouble import COUNTER_BITS, DEVICES, CountingDevice, device_of

COILS, INPUTS = Function.READ_COILS, Function.READ_DISCRETE_INPUTS
COUNTER: list[Bit] = [(INPUTS, address) for address in range(COUNTER_BITS)]


def read(reader: BitReader, device: CountingDevice) -> int:
    """A reading over a line without trouble; how many questions it took."""
    reader.begin()
    asked = 0
    while (request := reader.request()) is not None:
        asked += 1
        answer = device.answer(request)
        if answer is None:
            return asked
        assert reader.receive(answer) is AnswerKind.AWAITED
    return asked


def counter_in(reader: BitReader) -> int:
    return sum(value << address for (_, address), value in reader.bits.items())


@pytest.mark.parametrize("name", DEVICES)
def test_every_device_is_read_again_and_again(name: str) -> None:
    device, reader = device_of(name), BitReader(COUNTER)
    readings = 0
    for _ in range(20):
        before = device.counter
        read(reader, device)
        if reader.bits:
            readings += 1
            assert before < counter_in(reader) <= device.counter
    assert readings == 20 if device.refuses else readings >= 8


def test_numbered_answers_need_no_other_question() -> None:
    device, reader = CountingDevice(frozenset({INPUTS}), refuses=False), BitReader(COUNTER, numbered=True)
    complete = 0
    for _ in range(20):
        read(reader, device)
        complete += len(reader.bits) == COUNTER_BITS
    assert complete == 20 - 2 * 4  # four questions that it need not answer, each asked twice


def test_consecutive_questions_differ_in_length() -> None:
    device, reader = device_of("many inputs"), BitReader(COUNTER)
    read(reader, device)
    lengths = []
    for _ in range(8):
        reader.begin()
        while (request := reader.request()) is not None:
            lengths.append(request[4])
            answer = device.answer(request)
            assert answer is not None
            reader.receive(answer)
    assert lengths == [40, 16, 24, 32, 40, 16, 24, 32]


def test_all_bits_of_a_kind_are_asked_at_once_and_a_refused_one_is_found() -> None:
    device = CountingDevice(frozenset({INPUTS, COILS}), size=8)
    reader = BitReader([(INPUTS, 0), (INPUTS, 1), (COILS, 3), (INPUTS, 8)])
    for _ in range(3):
        read(reader, device)
        assert set(reader.bits) == {(INPUTS, 0), (INPUTS, 1), (COILS, 3)}
        assert reader.exceptions == {(INPUTS, 8): 2}


def test_addresses_further_apart_than_a_question_reaches() -> None:
    device = CountingDevice(frozenset({INPUTS}), size=65536)
    reader = BitReader([(INPUTS, 0), (INPUTS, 1999), (INPUTS, 2000), (INPUTS, 65535)])
    for _ in range(3):
        read(reader, device)
        assert len(reader.bits) == 4


@pytest.mark.parametrize("code", [1, 4, 6, 11])
def test_an_exception_is_no_value(code: int) -> None:
    device, reader = device_of("inputs and coils"), BitReader(COUNTER)
    read(reader, device)
    reader.begin()
    request = reader.request()
    assert request is not None
    assert reader.receive(bytes([request[0] | 0x80, code])) is AnswerKind.AWAITED
    assert reader.request() is None
    assert not reader.bits
    assert reader.exceptions == dict.fromkeys(COUNTER, code)
    read(reader, device)
    assert len(reader.bits) == COUNTER_BITS


@pytest.mark.parametrize("answer", ["", "02", "0202 00", "0202 000000", "0207 00000000000000", "0302 0000", "8202 00"])
def test_what_answers_no_question(answer: str) -> None:
    reader = BitReader(COUNTER)
    reader.begin()
    reader.request()
    assert reader.receive(bytes.fromhex(answer)) is AnswerKind.UNFIT


def test_a_late_answer_is_not_the_value_of_a_later_reading() -> None:
    device, reader = device_of("many inputs"), BitReader(COUNTER)
    read(reader, device)
    reader.begin()
    late = device.answer(reader.request() or b"")
    assert late is not None
    reader.begin()
    again = device.answer(reader.request() or b"")
    assert again is not None
    assert reader.receive(late) is AnswerKind.AWAITED
    assert not reader.bits
    current = device.answer(reader.request() or b"")
    assert current is not None
    assert reader.receive(again) is AnswerKind.REPEATED
    assert not reader.bits
    assert reader.receive(current) is AnswerKind.AWAITED
    assert counter_in(reader) == device.counter
