"""What a command found, and how it lies in the result block."""

from dataclasses import dataclass

from protocols.modbus.words import (
    WordOrder,
    Words,
    crc16,
    float_words,
    integer_words,
    text_words,
    unsigned_words,
)
from protocols.plc.codes import Command, Contents, Verdict
from protocols.plc.registers import REGISTERS, RESULT, SIZE, Kind, Register

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
Value = int | float | str

RESULT_REGISTERS = tuple(register for register in REGISTERS if register.address >= RESULT)
NO_RESULT: Words = (0,) * (SIZE - RESULT)


@dataclass(frozen=True)
class Camera:
    """X, flange_T_camera: mm, and a unit quaternion."""

    x_mm: Three
    quaternion_wxyz: Four


@dataclass(frozen=True)
class Sigma:
    """One standard deviation of X, and of a mapped point."""

    x_mm: Three
    rotation_deg: Three
    point_mm: float


@dataclass(frozen=True)
class Result:
    """How a command ended. What is None is not known, and `contents` of the block says so."""

    command: Command
    verdict: Verdict
    run_id: str = ""
    error_code: int = 0
    stations: int = 0
    age_s: int = 0
    camera: Camera | None = None
    sigma: Sigma | None = None
    deviation_mm: float | None = None

    def values(self) -> dict[str, Value]:
        """By the names of the register map; without the numbers that the handshake counts."""
        camera = self.camera or Camera((0.0,) * 3, (0.0,) * 4)
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
            **_each("x", "xyz", camera.x_mm),
            **_each("q", "wxyz", camera.quaternion_wxyz),
            **_each("sigma", "xyz", sigma.x_mm),
            **_each("sigma_r", "xyz", sigma.rotation_deg),
            "sigma_point": sigma.point_mm,
            "deviation": deviation_mm,
            **_each("x_um", "xyz", _scaled(camera.x_mm, 1e3)),
            **_each("q_ppm", "wxyz", _scaled(camera.quaternion_wxyz, 1e6)),
            **_each("sigma_um", "xyz", _scaled(sigma.x_mm, 1e3)),
            **_each("sigma_r_udeg", "xyz", _scaled(sigma.rotation_deg, 1e6)),
            "sigma_point_um": round(1e3 * sigma.point_mm),
            "deviation_um": round(1e3 * deviation_mm),
        }

    def _contents(self) -> Contents:
        known = (
            (self.camera, Contents.X), (self.sigma, Contents.UNCERTAINTY), (self.deviation_mm, Contents.DEVIATION)
        )  # fmt: skip
        return Contents(sum(bit for value, bit in known if value is not None))


def result_block(result: Result, number: int, acquisition: int, part_id: int, order: WordOrder) -> Words:
    """The registers from RESULT on, closed by their CRC."""
    counted = {"result_number": number, "result_acquisition": acquisition, "result_part": part_id}
    words = placed({**result.values(), **counted}, RESULT_REGISTERS, RESULT, SIZE - RESULT, order)
    return (*words[:-1], crc16(words[:-1]))


def placed(
    values: dict[str, Value], registers: tuple[Register, ...], first: int, count: int, order: WordOrder
) -> Words:
    """`values` by name in `count` words from address `first` on; what has no value is 0."""
    words = [0] * count
    for register in registers:
        if register.name in values:
            start = register.address - first
            words[start : start + register.registers] = words_of(register, values[register.name], order)
    return tuple(words)


def words_of(register: Register, value: Value, order: WordOrder) -> Words:
    """One value in its registers."""
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


def _each(name: str, axes: str, numbers: tuple[float, ...]) -> dict[str, Value]:
    return {f"{name}_{axis}": number for axis, number in zip(axes, numbers, strict=True)}


def _scaled(numbers: tuple[float, ...], factor: float) -> tuple[int, ...]:
    return tuple(round(number * factor) for number in numbers)
