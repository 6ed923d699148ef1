"""Reads and writes the frame of a tooldata or wobjdata in a controller's RAPID, over Robot Web Services."""

import re
from collections.abc import Sequence

from drivers.errors import GarbledAnswer, RequestRefused
from drivers.robots.abb.rws.administration import RwsAdministration

FRAME_AT = {"tooldata": 1, "wobjdata": 3}
"""Place of the frame among a record's components: tframe, uframe."""

LENGTH = {"tooldata": 3, "wobjdata": 5}
HELD = {"tooldata": "TRUE", "wobjdata": "FALSE"}
"""robhold: a tool that the robot holds, a work object that it does not hold."""

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_SAME = 1e-6
"""Relative difference of two numbers that a num holds as one."""


async def read_record(controller: RwsAdministration, symbol: str, kind: str) -> list[str]:
    """The components of the persistent `symbol`, as T_ROB1/camera_tool, of type tooldata or wobjdata, as RAPID writes
    them. Raises DeviceError, also for another type."""
    found = await controller.read_type(symbol)
    if found != kind:
        what = f"{symbol} is a {found}, not a {kind}" if found else f"there is no {symbol}"
        raise RequestRefused(controller.device, what, f"name a {kind}", "WRONG_TYPE")
    parts = components(await controller.read_symbol(symbol) or "")
    if len(parts) != LENGTH[kind]:
        raise GarbledAnswer(controller.device, f"{symbol} is no {kind}", "look at it on the pendant")
    if parts[0].upper() != HELD[kind]:
        what = f"robhold of {symbol} is {parts[0]}"
        raise RequestRefused(controller.device, what, f"set it to {HELD[kind]} on the pendant", "ROBHOLD")
    return parts


async def write_frame(controller: RwsAdministration, symbol: str, kind: str, parts: Sequence[str], frame: str) -> None:
    """Set the frame, leave the other components, and read back. Raises DeviceError.

    Needs mastership: the program must be stopped in AUTO, or the pendant grant it.
    """
    changed = [*parts]
    changed[FRAME_AT[kind]] = frame
    async with controller.hold_mastership("rapid"):
        await controller.write_symbol(symbol, f"[{','.join(changed)}]")
    if not same_value(",".join(await read_record(controller, symbol, kind)), ",".join(changed)):
        what = f"{symbol} reads back otherwise than it was written"
        raise GarbledAnswer(controller.device, what, "compare it on the pendant before anything moves")


def components(value: str) -> list[str]:
    """The components of a RAPID record, `[a,[b,c],"d"]`; empty when it is none."""
    text = value.strip()
    if not (text.startswith("[") and text.endswith("]")):
        return []
    parts, depth, quoted = [""], 0, False
    for character in text[1:-1]:
        quoted ^= character == '"'
        depth += 0 if quoted else {"[": 1, "]": -1}.get(character, 0)
        if character == "," and depth == 0 and not quoted:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def same_value(one: str, other: str) -> bool:
    """Whether two spellings are the same value: spaces do not count, numbers agree as IEEE singles do."""
    parts = [_NUMBER.split(re.sub(r"\s", "", text)) for text in (one, other)]
    numbers = [[float(found) for found in _NUMBER.findall(text)] for text in (one, other)]
    if [part.upper() for part in parts[0]] != [part.upper() for part in parts[1]]:
        return False
    return all(abs(a - b) <= _SAME * max(1.0, abs(a)) for a, b in zip(*numbers, strict=True))
