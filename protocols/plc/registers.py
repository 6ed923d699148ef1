"""The register map. docs/plc.md and docs/plc-registers.csv are generated from it.

One address space for functions 3 and 4. Coil n is bit n of register 0, discrete input n is bit n of register 16.
"""

from dataclasses import dataclass
from enum import StrEnum

CONTROL, STATUS, RESULT = 0, 16, 64
"""First address of each block."""


class Kind(StrEnum):
    """Encoding of a value in its registers."""

    BITS = "bits"
    UINT16 = "uint16"
    INT32 = "int32"
    UINT32 = "uint32"
    FLOAT32 = "float32"
    TEXT24 = "text24"


REGISTERS_OF: dict[Kind, int] = {
    Kind.BITS: 1, Kind.UINT16: 1, Kind.INT32: 2, Kind.UINT32: 2, Kind.FLOAT32: 2, Kind.TEXT24: 12
}  # fmt: skip


@dataclass(frozen=True)
class Register:
    """One named value. `writable`: the PLC may write it."""

    address: int
    name: str
    kind: Kind
    unit: str
    meaning: str
    writable: bool = False

    @property
    def registers(self) -> int:
        return REGISTERS_OF[self.kind]

    @property
    def addresses(self) -> range:
        return range(self.address, self.address + self.registers)


def _axes(address: int, name: str, kind: Kind, unit: str, axes: str, about: str) -> tuple[Register, ...]:
    """One register per letter of `axes`."""
    size = REGISTERS_OF[kind]
    return tuple(
        Register(address + size * k, f"{name}_{axis}", kind, unit, f"{about}, {axis}") for k, axis in enumerate(axes)
    )


_X = "position of the camera on the flange (X)"
_Q = "orientation of the camera on the flange, unit quaternion (ABB's q1..q4)"
_SX = "one standard deviation of X's position"
_SR = "one standard deviation of X's rotation about the camera's axis"
_POINT = "one standard deviation of a measured point"
_WORST = "U (k = 2) at the worst of the points that matter: what the tolerance is compared with"
_ASKED = "largest U that was accepted, in place of a stated one the default: see contents"
_EXPECTED = "U that was expected of the same views before the run"
_BEFORE = "U of the calibration that was active when this one was made"
_DEVIATION = (
    "calibrate: hold-out error; verify: largest scatter of the target over the positions; register: RMS between views"
)

_TOLERANCE = "U (k = 2) of the next calibrate or verify; 0: as in the settings"
_ARM_TEMPERATURE = (
    "of the arm's links, 1 to 1000; other values state none and forget none; each write of this register states it"
    " again, as POST /arm/temperature does"
)
_CAMERA = (
    "0: [camera]; n: the nth of [cameras] in the settings, or the scanner beside it; calibration_age, drift_state,"
    " drift_shift and their bits are of this camera"
)

REGISTERS: tuple[Register, ...] = (
    Register(0, "control", Kind.BITS, "", "triggers, acknowledge, abort, clear error: see its bits", True),
    Register(1, "heartbeat_in", Kind.UINT16, "", "the PLC changes it; see heartbeat_limit_s of the settings", True),
    Register(2, "stations_wanted", Kind.UINT16, "", "of the next calibrate; 0: as in the settings", True),
    Register(3, "part_id", Kind.UINT32, "", "any number of the PLC's; it comes back with the result", True),
    Register(5, "tolerance_wanted", Kind.UINT16, "µm", _TOLERANCE, True),
    Register(6, "camera_wanted", Kind.UINT16, "", _CAMERA, True),
    Register(7, "arm_temperature", Kind.UINT16, "0.1 °C", _ARM_TEMPERATURE, True),
    Register(16, "status", Kind.BITS, "", "see its bits"),
    Register(17, "command", Kind.UINT16, "", "the command in progress, or the last: 1 calibrate, 2 verify, 3 register"),
    Register(18, "error_code", Kind.UINT16, "", "set while the error bit is: see the table of codes"),
    Register(19, "acquisition_id", Kind.UINT16, "", "counts accepted triggers, to 65535, then 1 again"),
    Register(20, "result_id", Kind.UINT16, "", "counts ended commands in the same way; a gap means a result was lost"),
    Register(21, "heartbeat_out", Kind.UINT16, "", "counts up twice a second while the daemon works"),
    Register(22, "heartbeat_echo", Kind.UINT16, "", "heartbeat_in as last read"),
    Register(23, "map_version", Kind.UINT16, "", "version of this table"),
    Register(24, "constant_float", Kind.FLOAT32, "", "always 123.456: if it reads otherwise, the word order is wrong"),
    Register(26, "constant_int", Kind.INT32, "", "always 123456, for the same purpose"),
    Register(28, "station", Kind.UINT16, "", "stations done by the command in progress"),
    Register(29, "stations", Kind.UINT16, "", "stations planned"),
    Register(30, "calibration_age", Kind.UINT32, "s", "since the active calibration was made; 0 without one"),
    Register(32, "results_waiting", Kind.UINT16, "", "1 while a result waits for results_ack to be low"),
    Register(33, "drift_state", Kind.UINT16, "", "0 off, 1 learning, 2 steady, 3 drifting"),
    Register(34, "drift_shift", Kind.INT32, "µm", "how far the fixed target seems to have moved, averaged over time"),
    Register(64, "result_number", Kind.UINT16, "", "result_id of this block"),
    Register(65, "result_acquisition", Kind.UINT16, "", "acquisition_id of the trigger it answers"),
    Register(66, "result_command", Kind.UINT16, "", "1 calibrate, 2 verify, 3 register"),
    Register(67, "verdict", Kind.UINT16, "", "1 accepted, 2 rejected, 3 failed, 4 aborted"),
    Register(68, "result_error", Kind.UINT16, "", "why it failed or was aborted: see the table of codes; else 0"),
    Register(69, "result_stations", Kind.UINT16, "", "stations done"),
    Register(70, "contents", Kind.BITS, "", "which values below are valid: see its bits; the others are 0"),
    Register(71, "result_part", Kind.UINT32, "", "part_id when the command was triggered"),
    Register(73, "age", Kind.UINT32, "s", "age of the result's calibration when the result was written"),
    Register(75, "run_id", Kind.TEXT24, "", "of the run, as in the REST interface and the log"),
    *_axes(87, "x", Kind.FLOAT32, "mm", "xyz", _X),
    *_axes(93, "q", Kind.FLOAT32, "", "wxyz", _Q),
    *_axes(101, "sigma", Kind.FLOAT32, "mm", "xyz", _SX),
    *_axes(107, "sigma_r", Kind.FLOAT32, "deg", "xyz", _SR),
    Register(113, "sigma_point", Kind.FLOAT32, "mm", _POINT),
    Register(115, "deviation", Kind.FLOAT32, "mm", _DEVIATION),
    *_axes(117, "x_um", Kind.INT32, "µm", "xyz", _X),
    *_axes(123, "q_ppm", Kind.INT32, "1e-6", "wxyz", _Q),
    *_axes(131, "sigma_um", Kind.INT32, "µm", "xyz", _SX),
    *_axes(137, "sigma_r_udeg", Kind.INT32, "1e-6 deg", "xyz", _SR),
    Register(143, "sigma_point_um", Kind.INT32, "µm", _POINT),
    Register(145, "deviation_um", Kind.INT32, "µm", _DEVIATION),
    Register(147, "crc", Kind.UINT16, "", "CRC-16/MODBUS over registers 64 to 146 as they are read, high byte first"),
    Register(148, "u_worst", Kind.FLOAT32, "mm", _WORST),
    Register(150, "u_worst_um", Kind.INT32, "µm", _WORST),
    Register(152, "crc_all", Kind.UINT16, "", "the same over registers 64 to 151"),
    Register(153, "tolerance", Kind.FLOAT32, "mm", _ASKED),
    Register(155, "tolerance_um", Kind.INT32, "µm", _ASKED),
    Register(157, "u_expected", Kind.FLOAT32, "mm", _EXPECTED),
    Register(159, "u_expected_um", Kind.INT32, "µm", _EXPECTED),
    Register(161, "u_before", Kind.FLOAT32, "mm", _BEFORE),
    Register(163, "u_before_um", Kind.INT32, "µm", _BEFORE),
    Register(165, "worst_point", Kind.TEXT24, "", "name of the point of u_worst, its first 24 characters"),
    Register(177, "crc_whole", Kind.UINT16, "", "the same over registers 64 to 176"),
)  # fmt: skip

SIZE = REGISTERS[-1].address + REGISTERS[-1].registers
"""Addresses 0 to SIZE - 1 can be read; unnamed ones read 0."""

BY_NAME: dict[str, Register] = {register.name: register for register in REGISTERS}

WRITABLE: frozenset[int] = frozenset(
    address for register in REGISTERS if register.writable for address in register.addresses
)
"""Addresses the PLC may write."""
