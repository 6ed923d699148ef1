"""Files with poses as they come damaged: names changed, arrays transposed, rows lost, units and signs wrong, bytes cut.

Text is damaged by its numbers, names and lines, whatever its format; .npz by its arrays. What no file shows is left
out: all lengths of both sides in another unit, or the names of both sides exchanged.
"""

import io
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from calibration.transforms import Array

Random = np.random.Generator
FACTORS = (1000.0, 1e-3, 10.0, 0.1, 25.4, 57.29578, 0.01745329, 2.0)
PERIODS = (3, 4, 6, 7, 9, 12, 16)
NAMES = (
    "x", "y", "z", "qw", "qx", "rx", "a", "pose", "R", "t", "rvec", "tvec", "robot", "camera", "gripper2base",
    "base2gripper", "cam2target", "image", "time", "mm", "m", "deg", "rad", "", "joint1", "matrix", "data", "rows",
    "index",
)  # fmt: skip
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_NAME = re.compile(r"[A-Za-z_]\w*")


def _replace(text: str, match: re.Match[str], by: str) -> str:
    return text[: match.start()] + by + text[match.end() :]


def _one(pattern: re.Pattern[str], text: str, random: Random) -> re.Match[str] | None:
    found = list(pattern.finditer(text))
    return found[random.integers(len(found))] if found else None


def _cut(content: bytes, random: Random) -> bytes:
    return content[: random.integers(len(content) + 1)]


def _lose_bytes(content: bytes, random: Random) -> bytes:
    at = int(random.integers(len(content)))
    return content[:at] + content[at + int(random.integers(1, 40)) :]


def _repeat_bytes(content: bytes, random: Random) -> bytes:
    at = int(random.integers(len(content)))
    return content[:at] + content[max(at - int(random.integers(1, 60)), 0) :]


def _change_bytes(content: bytes, random: Random) -> bytes:
    changed = bytearray(content)
    for _ in range(random.integers(1, 4)):
        changed[random.integers(len(changed))] = random.integers(256)
    return bytes(changed)


def _of_text(change: Callable[[str, Random], str]) -> Callable[[bytes, Random], bytes]:
    return lambda content, random: change(content.decode("utf-8", "replace"), random).encode()


def _rename(text: str, random: Random) -> str:
    if (match := _one(_NAME, text, random)) is None:
        return text
    name = str(random.choice(NAMES))
    if random.random() < 0.5:
        return _replace(text, match, name)
    return re.sub(rf"\b{re.escape(match[0])}\b", name, text)


def _write_number(text: str, random: Random) -> str:
    by = str(random.choice(["", "nan", "null", "inf", "1e400", "-", "x", "0", "1_000", "--1", "[]", "{}", "1,5"]))
    return text if (match := _one(_NUMBER, text, random)) is None else _replace(text, match, by)


def _change_number(text: str, random: Random) -> str:
    if (match := _one(_NUMBER, text, random)) is None:
        return text
    factor = -1.0 if random.random() < 0.5 else float(random.choice(FACTORS))
    return _replace(text, match, f"{factor * float(match[0]):.9g}")


def _change_column(text: str, random: Random) -> str:
    """Every k-th number, of some in sequence, times a factor: a column in another unit or with another sign."""
    numbers, period = list(_NUMBER.finditer(text)), int(random.choice(PERIODS))
    width, at = int(random.choice([1, 3])), int(random.integers(period))
    factor = -1.0 if random.random() < 0.5 else float(random.choice(FACTORS))
    for index in range(len(numbers) - 1, -1, -1):
        if (index - at) % period < width and np.isfinite(value := float(numbers[index][0])):
            text = _replace(text, numbers[index], f"{factor * value:.9g}")
    return text


def _lose_lines(text: str, random: Random) -> str:
    lines = text.splitlines(keepends=True)
    at = int(random.integers(len(lines)))
    return "".join(lines[:at] + lines[at + int(random.integers(1, 4)) :])


def _exchange_lines(text: str, random: Random) -> str:
    lines = text.splitlines(keepends=True)
    one, other = random.integers(len(lines), size=2)
    lines[one], lines[other] = lines[other], lines[one]
    return "".join(lines)


def _repeat_line(text: str, random: Random) -> str:
    lines = text.splitlines(keepends=True)
    at, to = random.integers(len(lines), size=2)
    return "".join([*lines[:to], lines[at], *lines[to:]])


def _transpose_text(text: str, random: Random) -> str:
    """The lines of a table as columns."""
    lines = text.splitlines()
    separator = next((one for one in ",;\t " if one in lines[-1]), " ")
    cells = [line.split(separator) for line in lines]
    return "\n".join(separator.join(row[at] for row in cells if at < len(row)) for at in range(len(cells[-1])))


def _write_otherwise(text: str, random: Random) -> str:
    swaps = ((".", ","), (",", ";"), (",", " "), ("\n", "\r\n"), ("\n", " "), ('"', ""), ("[", "("), ("-", "\u2212"))
    old, new = swaps[random.integers(len(swaps))]
    return text.replace(old, new)


def _arrays_changed(content: bytes, random: Random) -> bytes:
    """One array of a JSON or NPZ file changed as a whole; other files by a column."""
    try:
        if content[:2] == b"PK":
            with np.load(io.BytesIO(content)) as stored:
                arrays: dict[str, Any] = {name: stored[name] for name in stored}
            name = str(random.choice(list(arrays)))
            arrays[name] = _change_array(arrays[name], random)
            stream = io.BytesIO()
            np.savez(stream, **arrays)
            return stream.getvalue()
        data = json.loads(content)
    except ValueError:
        return _of_text(_change_column)(content, random)
    places: list[tuple[Any, Any]] = []
    _array_places(data, places)
    if not places:
        return content
    chosen, key = places[random.integers(len(places))]
    chosen[key] = _change_array(np.array(chosen[key], float), random).tolist()
    return json.dumps(data).encode()


def _array_places(data: Any, places: list[tuple[Any, Any]]) -> None:
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        try:
            if isinstance(value, list) and np.array(value, float).ndim > 0:
                places.append((data, key))
        except (ValueError, TypeError):
            pass
        _array_places(value, places)


def _change_array(array: Array, random: Random) -> Array:
    n = len(array) if array.ndim else 0
    if n < 2:
        return -array
    match int(random.integers(9)):
        case 0:
            return np.swapaxes(array, -1, -2) if array.ndim > 1 else array[::-1]
        case 1:
            return array.T
        case 2:
            return np.delete(array, random.integers(n), axis=0)
        case 3:
            return array[::-1]
        case 4:
            return np.roll(array, 1, axis=0)
        case 5:
            return array * float(random.choice(FACTORS))
        case 6:
            return -array
        case 7:
            return np.concatenate([array, array[:1]])
        case _:
            changed = np.array(array, float)
            changed.flat[random.integers(changed.size)] *= -1
            return changed


DAMAGES: dict[str, Callable[[bytes, Random], bytes]] = {
    "cut": _cut,
    "bytes lost": _lose_bytes,
    "bytes repeated": _repeat_bytes,
    "bytes changed": _change_bytes,
    "name changed": _of_text(_rename),
    "number unreadable": _of_text(_write_number),
    "number changed": _of_text(_change_number),
    "column changed": _of_text(_change_column),
    "lines lost": _of_text(_lose_lines),
    "lines exchanged": _of_text(_exchange_lines),
    "line repeated": _of_text(_repeat_line),
    "table transposed": _of_text(_transpose_text),
    "written otherwise": _of_text(_write_otherwise),
    "array changed": _arrays_changed,
}
OF_BYTES = ("cut", "bytes lost", "bytes repeated", "bytes changed", "array changed")


def damage(content: bytes, random: Random) -> tuple[str, bytes]:
    """What was done to the content, and the damaged one."""
    is_text = b"\0" not in content
    name = str(random.choice([*DAMAGES] if is_text else OF_BYTES))
    changed = DAMAGES[name](content, random)
    return name, changed
