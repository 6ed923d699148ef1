"""What a cell's devices say of themselves in the first set-up. They are read; nothing is changed or moved."""

import asyncio
import socket
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from ipaddress import IPv4Interface
from typing import Any, TypeVar
from urllib.parse import urlsplit

import httpx
import numpy as np
from numpy.typing import NDArray

from calibration.documents.pose import PoseDocument
from calibration.kinematics.abb_arms import ARMS, SEVEN_AXIS_ARMS
from calibration.transforms import Array, inverse, transform_from_quaternion
from daemon.runtime.clock import Clock
from daemon.tools.first_setup.answers import Corner, corner_of
from drivers.errors import AddressNotUnderstood, DeviceError, DeviceTimeout, DeviceUnreachable
from drivers.interfaces import Camera, IdentifiedDevice
from drivers.registry import check_robot_address, open_camera, open_robot
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.announced import find_announced
from drivers.robots.abb.rws.controller_reader import ControllerReader
from drivers.robots.abb.setup.survey import ControllerSurvey, read_survey
from drivers.robots.base_frame import configured

MAX_CONNECT_S, RETRY_S, MAX_PICTURE_S = 4.0, 0.1, 20.0
USUAL_HOST, USUAL_SERVICES, REALM = "192.168.125.1", ("https://{host}/rw", "http://{host}/rw"), "robapi"
"""The service port of every controller; its Robot Web Services of RobotWare 7 and 6; what they call themselves."""
MAX_KNOCK_S, MAX_KNOCKS, MIN_PREFIX = 1.0, 64, 24
"""Of a search: per service, side by side, and what is searched of a network: 256 addresses."""
LINK_PORT, PORT_SETTING, TASK = 4242, "CELL_shared/cell_port", "T_ROB1"

Opened = TypeVar("Opened")
Answer = TypeVar("Answer")


@dataclass(frozen=True, eq=False)
class SeenController:
    """A controller that answers: `address` for the settings; `lines` for a person.

    `model`: the arm, if an option of the controller names it. `base_frame`: where the base stands in the world, None
    when they are one. `program_box_mm`: in the base; None over Robot Web Services, and for a base that is turned.
    `advice`: what keeps the daemon from moving the arm; empty when nothing does.
    """

    address: str
    lines: tuple[str, ...]
    model: str | None
    base_frame: PoseDocument | None
    program_box_mm: tuple[Corner, Corner] | None
    flange_mm: Corner
    joints_rad: tuple[float, ...] = ()
    advice: str = ""

    @property
    def world_T_base(self) -> Array | None:
        """(4, 4)"""
        return None if self.base_frame is None else self.base_frame.transform()


@dataclass(frozen=True, eq=False)
class SeenCamera:
    """A camera that answers: `address` for the settings, `who` for a person, and one picture."""

    address: str
    who: str
    image: NDArray[np.uint8]


async def ask(
    device: Opened, question: Callable[[Opened], Awaitable[Answer]], limit_s: float = MAX_CONNECT_S
) -> Answer:
    """The device's answer, asked again for `limit_s` while it is not connected yet. Raises DeviceError."""
    until_s = asyncio.get_running_loop().time() + limit_s
    while True:
        try:
            return await question(device)
        except (DeviceUnreachable, DeviceTimeout):
            if asyncio.get_running_loop().time() > until_s:
                raise
            await asyncio.sleep(RETRY_S)


async def find_controllers(hosts: Sequence[str] = (), services: Sequence[str] = USUAL_SERVICES) -> list[str]:
    """Those of the hosts at which Robot Web Services answer, asked side by side within seconds.

    By default the usual host, and those that announce themselves in this PC's networks.
    """
    if not hosts:
        own = [str(each.ip) for each in own_networks()]
        hosts = tuple(dict.fromkeys((USUAL_HOST, *await asyncio.to_thread(find_announced, own, MAX_KNOCK_S))))
    free = asyncio.Semaphore(MAX_KNOCKS)
    async with httpx.AsyncClient(verify=False, timeout=MAX_KNOCK_S, trust_env=False) as client:  # noqa: S501

        async def answers(host: str) -> bool:
            for service in services:
                with suppress(httpx.HTTPError):
                    async with free:
                        asked = await client.get(service.format(host=host))
                    if REALM in asked.headers.get("www-authenticate", ""):
                        return True
            return False

        found = await asyncio.gather(*map(answers, hosts))
    return [host for host, here in zip(hosts, found, strict=True) if here]


def own_networks() -> list[IPv4Interface]:
    """This PC's addresses in private networks, each with the 256 addresses around it."""
    own = set()
    for far in (USUAL_HOST, "192.168.255.254", "172.31.255.254", "10.255.255.254"):
        with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:  # sends nothing
            asked.connect((far, 9))
            own.add(asked.getsockname()[0])
    near = (IPv4Interface(f"{address}/{MIN_PREFIX}") for address in sorted(own))
    return [each for each in near if each.is_private and not each.is_loopback]


async def look_at_controller(answer: str, base_frame: PoseDocument | None = None) -> SeenController:
    """The controller at a host, or at an address: rws://..., http(s)://... of its services, tcp://... of the link.

    Its services say what it is, and at which port its program listens; the program moves the arm. `base_frame`: where
    the base stands, if they do not say it. Raises DeviceError.
    """
    fix = "write the controller's address, as 192.168.125.1"
    try:
        parts = urlsplit(answer if "//" in answer else f"rws://{answer}")
    except ValueError as error:
        raise AddressNotUnderstood(answer, str(error), fix) from None
    host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname
    link = answer if parts.scheme not in ("rws", "http", "https") else None
    if link is not None:
        check_robot_address(link)
    services = f"rws://{host}" if link else f"rws://{parts.netloc}" + (f"?{parts.query}" if parts.query else "")
    survey, problem = None, None
    if parts.hostname:
        try:
            async with ControllerReader(RwsAddress.parse(services)) as controller:
                survey = await read_survey(controller, (), (), (PORT_SETTING,), TASK)
        except DeviceError as error:
            problem = error
    elif link is None:
        raise AddressNotUnderstood(answer, "it names no host", fix)
    said = None if survey is None else next(iter(survey.symbols.values()), None)
    link = link or f"tcp://{host}:{LINK_PORT if said is None else int(float(said))}"
    seen = _controller_of(link, survey, base_frame)
    try:
        return await read_robot(seen)
    except DeviceError as error:
        if survey is None:
            raise (error if link == answer else problem or error) from None
        advice = f"{error.what}: the arm is read and pictures are taken by hand, until the robot program answers"
        return replace(await read_robot(replace(seen, address=services)), advice=advice)


def _controller_of(address: str, survey: ControllerSurvey | None, frame: PoseDocument | None) -> SeenController:
    """What the controller's services say of it."""
    if survey is None:
        return SeenController(address, (), None, frame, None, (0.0, 0.0, 0.0))
    options = [option.upper().replace(" ", "") for option in survey.options or ()]
    arms = sorted({**ARMS, **SEVEN_AXIS_ARMS}, key=len, reverse=True)
    named = (
        arm for arm in arms if any(arm.upper().replace(" ", "").removesuffix("LID") in option for option in options)
    )
    model = next(named, None)
    if survey.base_frame is not None:
        turned = transform_from_quaternion(survey.base_frame[:3], survey.base_frame[3:])
        frame = None if survey.base_at_world else PoseDocument.of(turned)
    lines = (*survey.summary(), f"options {', '.join(survey.options or ('unknown',))}")
    return SeenController(address, lines, model, frame, None, (0.0, 0.0, 0.0))


async def read_robot(seen: SeenController) -> SeenController:
    """The same, with how the arm stands now, and the box of the program. Raises DeviceError."""
    robot = open_robot(seen.address, world_T_base=seen.world_T_base)
    try:
        flange_mm = corner_of((await ask(robot, lambda it: it.read_pose())).base_T_flange)
        joints_rad = tuple(float(angle) for angle in await robot.read_joints())
        program = configured(robot)
        box = None if program is None else (await program.read_setup()).world_box_mm
    finally:
        await robot.close()
    if box is not None and seen.world_T_base is not None:
        upright = np.allclose(seen.world_T_base[:3, :3], np.eye(3), atol=1e-6)
        x, y, z = (float(value) for value in inverse(seen.world_T_base)[:3, 3])
        (low_x, low_y, low_z), (high_x, high_y, high_z) = box
        box = ((low_x + x, low_y + y, low_z + z), (high_x + x, high_y + y, high_z + z)) if upright else None
    return replace(seen, program_box_mm=box, flange_mm=flange_mm, joints_rad=joints_rad)


async def take_picture(address: str) -> SeenCamera:
    """One picture of the camera at an address. Raises DeviceError."""
    camera = open_camera(address.strip(), limit_s=MAX_PICTURE_S)
    try:
        frame = await ask(camera, lambda it: it.grab(Clock().monotonic_s()))
        return SeenCamera(address.strip(), await name_of(camera), frame.image)
    finally:
        await camera.close()


async def name_of(camera: Camera) -> str:
    """Vendor, model and serial number; empty for a camera that does not report them. Raises DeviceError."""
    if not isinstance(camera, IdentifiedDevice):
        return ""
    who: Any = await camera.identify()
    return f"{who.vendor} {who.model}, serial number {who.serial}"
