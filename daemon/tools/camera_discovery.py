"""Cameras that answer discovery: who they are, under which address a setting opens them, and what they can."""

import asyncio
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from drivers.cameras.genicam.device import FoundCamera, Library, VendorError
from drivers.errors import DeviceError
from drivers.interfaces import IdentifiedDevice
from drivers.registry import LIBRARIES, open_camera

MAX_OPEN_S = 10.0
"""Seconds in which a camera that was found must open."""


@dataclass(frozen=True)
class Discovery:
    """A camera that was found, or what kept one interface from looking: `problem` with its `fix`, else empty.

    `address`: for the settings; of a failed search the scheme alone. `abilities` as in DeviceIdentity.
    """

    address: str
    vendor: str = ""
    model: str = ""
    serial: str = ""
    network_address: str = ""
    abilities: tuple[str, ...] = ()
    problem: str = ""
    fix: str = ""

    def line(self) -> str:
        """One line for people."""
        who = " ".join(part for part in (self.vendor, self.model) if part)
        parts = [who, f"serial number {self.serial}" if self.serial else "", self.network_address]
        parts += [", ".join(self.abilities), f"{self.problem}: {self.fix}" if self.problem else ""]
        return f"{self.address:<28}" + "; ".join(part for part in parts if part)


def discover(
    libraries: Mapping[str, Callable[[], Library]] = LIBRARIES, video_folder: Path = Path("/dev")
) -> list[Discovery]:
    """Every camera of every interface. Opens those that are free, one after the other, to ask what they can."""
    found = [entry for scheme, make in libraries.items() for entry in _search(scheme, make)]
    return found + [Discovery(f"video:{path}") for path in sorted(video_folder.glob("video[0-9]*"))]


def _search(scheme: str, make: Callable[[], Library]) -> Iterator[Discovery]:
    try:
        cameras = make().discover()
    except DeviceError as error:
        yield Discovery(f"{scheme}:", problem=error.what, fix=error.fix)
        return
    except VendorError as error:
        yield Discovery(f"{scheme}:", problem=str(error), fix="check the library's installation")
        return
    for camera in cameras:
        yield asyncio.run(_identify(f"{scheme}:{camera.serial or camera.key}", camera))


async def _identify(address: str, found: FoundCamera) -> Discovery:
    known = (address, found.vendor, found.model, found.serial, found.address)
    camera = open_camera(address, limit_s=MAX_OPEN_S)
    try:
        if not isinstance(camera, IdentifiedDevice):
            return Discovery(*known)
        return Discovery(*known, (await camera.identify()).abilities)
    except DeviceError as error:
        return Discovery(*known, problem=error.what, fix=error.fix)
    finally:
        await camera.close()
