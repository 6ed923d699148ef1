"""Reads and writes the frame of a tooldata or wobjdata in a controller's RAPID, over Robot Web Services."""

from collections.abc import Sequence

import numpy as np

from drivers.errors import GarbledAnswer, RequestRefused
from drivers.robots.abb.rws import parsing
from drivers.robots.abb.rws.client import RwsClient

FRAME_AT = {"tooldata": 1, "wobjdata": 3}
"""Place of the frame among a record's components: tframe, uframe."""

LENGTH = {"tooldata": 3, "wobjdata": 5}
HELD = {"tooldata": "TRUE", "wobjdata": "FALSE"}
"""robhold: a tool that the robot holds, a work object that it does not hold."""

READ_BACK_TOLERANCE = 1e-6
"""Relative: num is a single float."""


class RapidFrame:
    """The frame of the persistent `symbol`, as T_ROB1/camera_tool, of type tooldata or wobjdata."""

    def __init__(self, client: RwsClient, symbol: str, kind: str) -> None:
        self._client, self._device, self._symbol, self._kind = client, client.device, symbol, kind

    async def read(self) -> list[str]:
        """The components of the record, as RAPID writes them. Raises DeviceError, also for another type."""
        dialect = await self._client.find()
        paths = (
            (f"/rw/rapid/symbol/properties/RAPID/{self._symbol}", f"/rw/rapid/symbol/data/RAPID/{self._symbol}")
            if dialect.version == 1
            else (f"/rw/rapid/symbol/RAPID/{self._symbol}/properties", f"/rw/rapid/symbol/RAPID/{self._symbol}/data")
        )
        kind = await self._word(paths[0], "dattyp")
        if kind != self._kind:
            what = f"{self._symbol} is a {kind}, not a {self._kind}"
            raise RequestRefused(self._device, what, f"name a {self._kind}", "WRONG_TYPE")
        parts = components(await self._word(paths[1], "value"))
        if len(parts) != LENGTH[self._kind]:
            raise GarbledAnswer(self._device, f"{self._symbol} is no {self._kind}", "look at it on the pendant")
        if parts[0].upper() != HELD[self._kind]:
            what = f"robhold of {self._symbol} is {parts[0]}"
            raise RequestRefused(self._device, what, f"set it to {HELD[self._kind]} on the pendant", "ROBHOLD")
        return parts

    async def write(self, parts: Sequence[str], frame: str) -> None:
        """Set the frame, leave the other components, and read back. Raises DeviceError.

        Needs mastership: the program must be stopped in AUTO, or the pendant grant it.
        """
        dialect = await self._client.find()
        changed = [*parts]
        changed[FRAME_AT[self._kind]] = frame
        path, query = dialect.set_symbol(self._symbol)
        await self._client.post(*dialect.mastership("rapid", "request"), {})
        try:
            await self._client.post(path, query, {"value": f"[{','.join(changed)}]"})
        finally:
            await self._client.post(*dialect.mastership("rapid", "release"), {})
        if not _same(await self.read(), changed):
            what = f"{self._symbol} reads back otherwise than it was written"
            raise GarbledAnswer(self._device, what, "compare it on the pendant before anything moves")

    async def _word(self, path: str, name: str) -> str:
        found = await self._client.get(path)
        return parsing.word(self._device, found[0] if found else {}, name)


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


def _same(found: Sequence[str], wanted: Sequence[str]) -> bool:
    """Whether two records are equal, numbers as single floats."""
    return len(found) == len(wanted) and all(_equal(a, b) for a, b in zip(found, wanted, strict=True))


def _equal(a: str, b: str) -> bool:
    if a.startswith("[") and b.startswith("["):
        return _same(components(a), components(b))
    try:
        return bool(np.isclose(float(a), float(b), rtol=READ_BACK_TOLERANCE, atol=READ_BACK_TOLERANCE))
    except ValueError:
        return a.upper() == b.upper()
