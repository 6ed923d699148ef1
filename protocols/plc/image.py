"""The registers a PLC reads, from the state of the handshake."""

from protocols.modbus.words import Words
from protocols.plc.codes import MAP_VERSION, DriftState, Status
from protocols.plc.events import CellSeen
from protocols.plc.handshake import Handshake, Phase
from protocols.plc.registers import REGISTERS, RESULT, STATUS
from protocols.plc.results import Value, placed

STATUS_REGISTERS = tuple(register for register in REGISTERS if STATUS <= register.address < RESULT)

CONSTANT_FLOAT, CONSTANT_INT = 123.456, 123456

NOTHING_SEEN = CellSeen(ready=False)


def image_of(state: Handshake) -> Words:
    """All registers from address 0 on."""
    status = placed(_values(state), STATUS_REGISTERS, STATUS, RESULT - STATUS, state.rules.order)
    return (*state.written, *(0,) * (STATUS - len(state.written)), *status, *state.shown)


def status_of(state: Handshake) -> Status:
    """The status register."""
    cell = state.cell or NOTHING_SEEN
    bits = (
        (state.ready, Status.READY),
        (state.answered, Status.TRIGGER_ACK),
        (cell.in_force, Status.CALIBRATION_IN_FORCE),
        (state.missed, Status.MISSED_TRIGGER),
        (cell.drift is DriftState.DRIFTING, Status.DRIFT_ALARM),
        (state.rules.motion_allowed, Status.MOTION_ALLOWED),
        (state.silent, Status.PLC_SILENT),
        (state.cell is not None, Status.ONLINE),
        (state.phase is not Phase.IDLE, Status.BUSY),
        (state.completed, Status.COMPLETED),
        (state.overrun, Status.BUFFER_OVERRUN),
        (state.valid, Status.RESULTS_VALID),
        (bool(state.error_code), Status.ERROR),
    )
    return Status(sum(bit for hit, bit in bits if hit))


def _values(state: Handshake) -> dict[str, Value]:
    cell = state.cell or NOTHING_SEEN
    return {
        "status": status_of(state),
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
        "results_waiting": len(state.waiting),
        "drift_state": cell.drift,
        "drift_shift": cell.drift_shift_um,
    }
