"""Encodes the registers a PLC reads from the state of the handshake."""

from protocols.modbus.words import Words
from protocols.plc.codes import MAP_VERSION, DriftState, StatusBit
from protocols.plc.events import CellStatus
from protocols.plc.handshake import Handshake, Phase
from protocols.plc.registers import REGISTERS, RESULT, STATUS
from protocols.plc.results import Value, encode_block

STATUS_REGISTERS = tuple(register for register in REGISTERS if STATUS <= register.address < RESULT)

CONSTANT_FLOAT, CONSTANT_INT = 123.456, 123456

UNKNOWN_CELL = CellStatus(ready=False)


def register_image(state: Handshake) -> Words:
    """All registers from address 0 on."""
    status = encode_block(_values(state), STATUS_REGISTERS, STATUS, RESULT - STATUS, state.rules.order)
    return (*state.written, *(0,) * (STATUS - len(state.written)), *status, *state.shown)


def status_bits(state: Handshake) -> StatusBit:
    """Bits of the status register."""
    cell = state.cell or UNKNOWN_CELL
    bits = (
        (state.ready, StatusBit.READY),
        (state.answered, StatusBit.TRIGGER_ACK),
        (cell.in_force, StatusBit.CALIBRATION_IN_FORCE),
        (state.missed, StatusBit.MISSED_TRIGGER),
        (cell.drift is DriftState.DRIFTING, StatusBit.DRIFT_ALARM),
        (state.rules.motion_allowed, StatusBit.MOTION_ALLOWED),
        (state.silent, StatusBit.PLC_SILENT),
        (state.cell is not None, StatusBit.ONLINE),
        (state.phase is not Phase.IDLE, StatusBit.BUSY),
        (state.completed, StatusBit.COMPLETED),
        (state.valid, StatusBit.RESULTS_VALID),
        (cell.stop_unconfirmed, StatusBit.STOP_UNCONFIRMED),
        (bool(state.error_code), StatusBit.ERROR),
    )
    return StatusBit(sum(bit for hit, bit in bits if hit))


def _values(state: Handshake) -> dict[str, Value]:
    cell = state.cell or UNKNOWN_CELL
    return {
        "status": status_bits(state),
        "command": state.command,
        "error_code": state.error_code,
        "acquisition_id": state.acquisition_id,
        "result_id": state.result_id,
        "heartbeat_out": state.heartbeat_out,
        "heartbeat_echo": state.input("heartbeat_in"),
        "map_version": MAP_VERSION,
        "constant_float": CONSTANT_FLOAT,
        "constant_int": CONSTANT_INT,
        "station": state.station,
        "stations": state.stations,
        "calibration_age": cell.calibration_age_s,
        "results_waiting": int(state.waiting is not None),
        "drift_state": cell.drift,
        "drift_shift": cell.drift_shift_um,
    }
