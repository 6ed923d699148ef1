"""Result of a command, and its encoding in the result block."""

from dataclasses import dataclass

from protocols.modbus.words import WordOrder, Words, crc16, float_words, integer_words, text_words, unsigned_words
from protocols.plc.codes import ContentsBit, PlcCommand, PlcVerdict
from protocols.plc.registers import BY_NAME, REGISTERS, RESULT, SIZE, Kind, Register

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
Value = int | float | str

RESULT_REGISTERS = tuple(register for register in REGISTERS if register.address >= RESULT)
NO_RESULT: Words = (0,) * (SIZE - RESULT)


@dataclass(frozen=True)
class CameraPose:
    """X as flange_T_camera: mm, and a unit quaternion."""

    x_mm: Three
    quaternion_wxyz: Four


@dataclass(frozen=True)
class Sigma:
    """Standard deviations of X and of a measured point."""

    x_mm: Three
    rotation_deg: Three
    point_mm: float


@dataclass(frozen=True)
class Accuracy:
    """U (k = 2, mm) at the worst of the points that matter, beside what it is judged by; None where it is not known.

    `unexpected`: found and expected U part by more than a factor of 1.5.
    """

    expanded_mm: float | None = None
    worst_point: str = ""
    tolerance_mm: float | None = None
    tolerance_stated: bool = False
    expected_mm: float | None = None
    before_mm: float | None = None
    unexpected: bool = False

    def values(self) -> dict[str, Value]:
        """Values by register name: each length in mm, and as an integer in um."""
        lengths = {"u_worst": self.expanded_mm, "tolerance": self.tolerance_mm, "u_expected": self.expected_mm,
                   "u_before": self.before_mm}  # fmt: skip
        known: dict[str, Value] = {"worst_point": self.worst_point}
        for name, length_mm in lengths.items():
            known |= {name: length_mm or 0.0, f"{name}_um": round(1e3 * (length_mm or 0.0))}
        return known

    def contents(self) -> ContentsBit:
        bits = (
            (self.expanded_mm is not None, ContentsBit.WORST_POINT),
            (self.tolerance_mm is not None, ContentsBit.TOLERANCE),
            (self.tolerance_stated, ContentsBit.TOLERANCE_STATED),
            (self.expected_mm is not None, ContentsBit.EXPECTED),
            (self.before_mm is not None, ContentsBit.BEFORE),
            (self.unexpected, ContentsBit.UNEXPECTED),
        )
        return ContentsBit(sum(bit for known, bit in bits if known))


@dataclass(frozen=True)
class CommandResult:
    """Result of a command. None marks an unknown value, which the block's `contents` shows as missing.

    `in_force`: the calibration of the result is the active one.
    """

    command: PlcCommand
    verdict: PlcVerdict
    run_id: str = ""
    error_code: int = 0
    stations: int = 0
    age_s: int = 0
    camera: CameraPose | None = None
    sigma: Sigma | None = None
    deviation_mm: float | None = None
    accuracy: Accuracy = Accuracy()
    in_force: bool = False

    def values(self) -> dict[str, Value]:
        """Values by register name, without the counters of the handshake."""
        camera = self.camera or CameraPose((0.0,) * 3, (0.0,) * 4)
        sigma = self.sigma or Sigma((0.0,) * 3, (0.0,) * 3, 0.0)
        deviation_mm = self.deviation_mm or 0.0
        return {
            "result_command": self.command,
            "verdict": self.verdict,
            "result_error": self.error_code,
            "result_stations": self.stations,
            "contents": self._contents(),
            "age": self.age_s,
            "run_id": self.run_id,
            **_by_axis("x", "xyz", camera.x_mm),
            **_by_axis("q", "wxyz", camera.quaternion_wxyz),
            **_by_axis("sigma", "xyz", sigma.x_mm),
            **_by_axis("sigma_r", "xyz", sigma.rotation_deg),
            "sigma_point": sigma.point_mm,
            "deviation": deviation_mm,
            **_by_axis("x_um", "xyz", _to_integers(camera.x_mm, 1e3)),
            **_by_axis("q_ppm", "wxyz", _to_integers(camera.quaternion_wxyz, 1e6)),
            **_by_axis("sigma_um", "xyz", _to_integers(sigma.x_mm, 1e3)),
            **_by_axis("sigma_r_udeg", "xyz", _to_integers(sigma.rotation_deg, 1e6)),
            "sigma_point_um": round(1e3 * sigma.point_mm),
            "deviation_um": round(1e3 * deviation_mm),
            **self.accuracy.values(),
        }

    def _contents(self) -> ContentsBit:
        known = (
            (self.camera, ContentsBit.X),
            (self.sigma, ContentsBit.UNCERTAINTY),
            (self.deviation_mm, ContentsBit.DEVIATION),
            (self.in_force or None, ContentsBit.IN_FORCE),
        )
        return ContentsBit(sum(bit for value, bit in known if value is not None)) | self.accuracy.contents()


def result_block(result: CommandResult, number: int, acquisition: int, part_id: int, order: WordOrder) -> Words:
    """Encode the registers from RESULT on. Each of the sums closes all registers before it."""
    counted = {"result_number": number, "result_acquisition": acquisition, "result_part": part_id}
    words = list(encode_block({**result.values(), **counted}, RESULT_REGISTERS, RESULT, SIZE - RESULT, order))
    for name in ("crc", "crc_all", "crc_whole"):
        place = BY_NAME[name].address - RESULT
        words[place] = crc16(words[:place])
    return tuple(words)


def encode_block(
    values: dict[str, Value], registers: tuple[Register, ...], first: int, count: int, order: WordOrder
) -> Words:
    """Encode `values` (by register name) in `count` words from address `first` on; values not given are 0."""
    words = [0] * count
    for register in registers:
        if register.name in values:
            start = register.address - first
            words[start : start + register.registers] = encode_value(register, values[register.name], order)
    return tuple(words)


def encode_value(register: Register, value: Value, order: WordOrder) -> Words:
    match register.kind, value:
        case Kind.TEXT24, str():
            return text_words(value, register.registers)
        case Kind.FLOAT32, int() | float():
            return float_words(value, order)
        case Kind.INT32, int():
            return integer_words(value, order)
        case Kind.UINT32, int():
            return unsigned_words(value, order)
        case ((Kind.UINT16 | Kind.BITS), int()):
            return (min(max(int(value), 0), 0xFFFF),)
        case _:
            raise TypeError(f"{register.name} is {register.kind}, and {value!r} is not")


def _by_axis(name: str, axes: str, numbers: tuple[float, ...]) -> dict[str, Value]:
    return {f"{name}_{axis}": number for axis, number in zip(axes, numbers, strict=True)}


def _to_integers(numbers: tuple[float, ...], factor: float) -> tuple[int, ...]:
    return tuple(round(number * factor) for number in numbers)
