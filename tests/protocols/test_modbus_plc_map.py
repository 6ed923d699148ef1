"""The register map is one table: nothing overlaps, everything is explained, and the documents are written from it."""

from pathlib import Path

import pytest

from daemon import errors as daemon_errors
from drivers import errors as driver_errors
from protocols.modbus.words import WordOrder, crc16, text_of, unsigned_of
from protocols.plc.codes import ERROR_CODES, UNKNOWN, PlcCommand, PlcVerdict, number_of
from protocols.plc.registers import BY_NAME, REGISTERS, RESULT, SIZE, WRITABLE, Kind
from protocols.plc.results import Accuracy, CameraPose, CommandResult, Sigma, result_block
from tests.protocols.register_docs import BIT_MEANINGS, BITS, csv_text, markdown_text
from tests.support.registers import float_of, integer_of

DOCS = Path(__file__).resolve().parents[2] / "docs"

RESULT_OF_ALL = CommandResult(
    PlcCommand.CALIBRATE, PlcVerdict.ACCEPTED, "20261121-090000-3f9a1c", 0, 8, 61,
    CameraPose((40.125, -25.5, 90.0625), (0.5, -0.5, 0.5, -0.5)),
    Sigma((0.01, 0.02, 0.03), (0.001, 0.002, 0.003), 0.0625), 0.125,
    Accuracy(0.25, "far top left", 0.5, True, 0.125, 0.375, unexpected=True),
)  # fmt: skip


def test_no_two_registers_share_an_address_and_names_are_unique() -> None:
    addresses = [address for register in REGISTERS for address in register.addresses]
    assert addresses == sorted(set(addresses))
    assert len(BY_NAME) == len(REGISTERS)
    assert max(addresses) == SIZE - 1


def test_a_result_block_is_read_with_one_request_and_has_no_gap() -> None:
    block = [address for register in REGISTERS if register.address >= RESULT for address in register.addresses]
    assert block == list(range(RESULT, SIZE))
    assert len(block) <= 125


def test_the_writable_registers_are_the_first_ones() -> None:
    assert sorted(WRITABLE) == list(range(len(WRITABLE)))


def test_every_bit_is_explained() -> None:
    assert {(kind, bit) for kind in BITS.values() for bit in kind} == set(BIT_MEANINGS)


def test_what_a_plc_can_run_into_has_a_number() -> None:
    """Everything a device raises, and what of the daemon refuses or ends a run; the rest is UNKNOWN, and in the log."""
    of_a_run = (
        "RunInProgress", "CellBusy", "CellNotReady", "NotStill", "PictureUnusable", "NoPoses", "PoseRefused",
        "NoCalibration", "CalibrationUnusable", "TargetNotSeen", "NoScanner", "ScanEmpty", "StorageError",
        "StorageFull", "Stopping", "NotFound", "RunStalled",
    )  # fmt: skip
    codes = {getattr(daemon_errors, name).code for name in of_a_run}
    codes |= {kind.code for kind in vars(driver_errors).values() if isinstance(getattr(kind, "code", None), str)}
    assert {code for code in codes if number_of(code) == UNKNOWN} == set()
    assert number_of("never heard of") == UNKNOWN


def test_numbers_of_errors_mean_one_thing() -> None:
    meanings: dict[int, set[str]] = {}
    for number, meaning in ERROR_CODES.values():
        meanings.setdefault(number, set()).add(meaning)
    assert all(len(words) == 1 for words in meanings.values())
    assert 0 not in meanings
    assert max(meanings) < UNKNOWN


@pytest.mark.parametrize("order", WordOrder)
def test_a_result_reads_as_it_was_in_both_word_orders(order: WordOrder) -> None:
    block = result_block(RESULT_OF_ALL, 7, 9, 4_000_000_000, order)

    def read(name: str) -> object:
        register = BY_NAME[name]
        words = block[register.address - RESULT :][: register.registers]
        of = {Kind.FLOAT32: float_of, Kind.INT32: integer_of, Kind.UINT32: unsigned_of}
        if register.kind in of:
            return of[register.kind](words, order)
        return text_of(words) if register.kind is Kind.TEXT24 else words[0]

    expected = {
        "result_number": 7, "result_acquisition": 9, "result_command": 1, "verdict": 1, "result_error": 0,
        "result_stations": 8, "contents": 511, "result_part": 4_000_000_000, "age": 61,
        "run_id": "20261121-090000-3f9a1c", "x_x": 40.125, "x_y": -25.5, "q_y": 0.5, "sigma_point": 0.0625,
        "deviation": 0.125, "x_um_x": 40125, "x_um_z": 90062, "q_ppm_x": -500000, "sigma_um_z": 30,
        "sigma_r_udeg_x": 1000, "sigma_point_um": 62, "deviation_um": 125,
        "u_worst": 0.25, "u_worst_um": 250, "worst_point": "far top left", "tolerance": 0.5, "tolerance_um": 500,
        "u_expected": 0.125, "u_expected_um": 125, "u_before": 0.375, "u_before_um": 375,
    }  # fmt: skip
    assert {name: read(name) for name in expected} == expected
    for name in ("crc", "crc_all", "crc_whole"):
        end = BY_NAME[name].address - RESULT
        assert block[end] == crc16(block[:end])


def test_what_is_not_known_is_zero_and_said_to_be() -> None:
    block = result_block(
        CommandResult(PlcCommand.VERIFY, PlcVerdict.FAILED, error_code=30), 1, 1, 0, WordOrder.HIGH_FIRST
    )
    assert block[BY_NAME["contents"].address - RESULT] == 0
    ends = (BY_NAME["crc"].address - RESULT, BY_NAME["crc_all"].address - RESULT)
    assert not any(block[BY_NAME["x_x"].address - RESULT : ends[0]] + block[ends[0] + 1 : ends[1]])


def test_the_documents_are_up_to_date() -> None:
    """`python -m tests.protocols.register_docs` writes both."""
    assert (DOCS / "plc-registers.csv").read_text(encoding="utf-8") == csv_text(), (
        "python -m tests.protocols.register_docs"
    )
    assert markdown_text() in (DOCS / "plc.md").read_text(encoding="utf-8"), "python -m tests.protocols.register_docs"
