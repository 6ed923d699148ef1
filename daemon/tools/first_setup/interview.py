"""The interview of the first set-up, the same in a terminal and the page: each answer is checked when it is given."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from math import degrees
from pathlib import Path

import numpy as np

from calibration.documents.pose import Vector
from calibration.documents.target_text import target_of_text, text_of_target
from calibration.documents.validation import Document
from calibration.errors import DetectionError
from calibration.kinematics.abb_arms import find_any_arm
from calibration.problem import Setup
from calibration.targets import Target
from daemon.cell.skeleton import lengths_mm, skeleton_mm
from daemon.errors import AnswerRefused
from daemon.tools.first_setup.answers import (
    EDGES,
    Corner,
    TargetSize,
    box_of,
    parse_corners,
    parse_setup,
    parse_size,
    parse_tolerance,
)
from daemon.tools.first_setup.devices import (
    SeenCamera,
    SeenController,
    find_controllers,
    look_at_controller,
    own_networks,
    read_robot,
    take_picture,
)
from daemon.tools.first_setup.settings_before import SettingsBefore, without_password

QUESTIONS: dict[str, str] = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
"""What a terminal asks, in order, by the name of the answer."""

USUAL = {"model": "", "setup": "arm", "target": "", "tolerance": "1"}
"""Answers of who presses Enter."""


class DrawnArm(Document):
    """The arm as it stands, to draw it: see `GET /arm` and `GET /robot`."""

    lengths_mm: tuple[float, ...] | None
    """Of its links; null for an arm with seven axes."""
    joints_deg: tuple[float, ...]
    """Its axes."""
    skeleton_mm: tuple[Vector, ...]
    """Base, shoulder, elbow, wrist and flange in the base."""


class AnswerFound(Document):
    """What came of an answer."""

    answer: str = ""
    """The answer as it stays: places of the arm as numbers, a target in words."""
    complete: bool = True
    """Whether it settles the question; else ask again, with `answer` proposed."""
    found: tuple[str, ...] = ()
    """What the device says, or what follows from the answer: lines for a person."""
    doubts: tuple[str, ...] = ()
    """What to look at before going on."""
    model: str | None = None
    """The arm that the controller names."""
    flange_mm: Vector | None = None
    """Where the flange stands, mm in the base."""
    program_box_mm: tuple[Vector, Vector] | None = None
    """The box that the robot's program allows, mm in the base."""
    arm: DrawnArm | None = None
    """The arm as it stands, where its model is known."""
    target: str | None = None
    """The target that the picture shows, in words."""
    size: tuple[int, int] | None = None
    """Width and height of the picture, px."""
    corners: tuple[tuple[int, float, float], ...] = ()
    """The target's points in the picture: id, u, v in px."""
    of: int | None = None
    """How many points the target has."""
    expected_mm: float | None = None
    """U (k = 2) to expect of eight planned pictures of this target by this camera, with an arm as delivered."""


@dataclass(eq=False)
class Interview:
    """What was answered so far; all of it before `settings_text`."""

    controller: SeenController | None = None
    camera: SeenCamera | None = None
    model: str | None = None
    setup: Setup = "eye-in-hand"
    target: Target | None = None
    size: TargetSize | None = None
    tolerance_mm: float = 1.0
    expected_mm: float | None = None
    box_mm: tuple[Corner, Corner] | None = None
    corners: list[Corner] = field(default_factory=list)
    before: SettingsBefore = field(default_factory=SettingsBefore)

    async def take(self, name: str, text: str) -> AnswerFound:
        """Check the answer to a question, asking the devices. Raises AnswerRefused, CalibrationError, DeviceError."""
        given = self.before.with_password(text.strip())
        found = await TAKES[name](self, given)
        return found if given == text.strip() else found.model_copy(update={"answer": text.strip()})

    def settings_text(self) -> str:
        """The settings file: what was asked, what stays of the one before, and nothing that has a default."""
        seen, camera, size = self.controller, self.camera, self.size
        assert seen is not None and camera is not None and size is not None and self.box_mm is not None
        frame = None if seen.base_frame is None else seen.base_frame.model_dump(mode="json")
        target = {name: value for name, value in asdict(size.target).items() if value is not False}
        before = self.before.settings
        known = size.known
        if not known and size.target == before.target:  # certified, or measured in a way that is not asked
            known = before.calibration.known.target.model_dump(exclude_unset=True)
        return self.before.text_with(
            {
                "robot": {"address": seen.address, "model": self.model, "base_frame": frame, "box_mm": self.box_mm},
                "camera": {"address": camera.address, "setup": self.setup},
                "target": {"kind": size.target.kind, **target},
                "calibration": {"tolerance_mm": self.tolerance_mm, "known": {"target": known}},
            }
        )

    async def take_controller(self, text: str) -> AnswerFound:
        """A controller's address; `search` looks through this PC's networks."""
        if text == "search":
            networks = own_networks()
            hosts = [str(host) for each in networks for host in each.network.hosts() if host != each.ip]
            if not (found := await find_controllers(hosts)):
                where = ", ".join(str(each.network) for each in networks) or "no private network"
                raise AnswerRefused(f"no controller answers in {where}", "write its address")
            return AnswerFound(answer=found[0], complete=False, found=tuple(found))
        robot = self.before.settings.robot
        frame = robot.base_frame if text == robot.address else None
        self.controller = seen = await look_at_controller(text, frame)
        self.model = seen.model
        at = ", ".join(f"{value:.0f}" for value in seen.flange_mm)
        stands = f"flange at ({at}) mm; [robot] address {without_password(seen.address)}"
        return AnswerFound(
            answer=text,
            found=(*seen.lines, stands, f"arm {seen.model or 'not named'}"),
            doubts=(f"{seen.advice}; install it with: handeyed robot setup",) if seen.advice else (),
            model=seen.model,
            flange_mm=seen.flange_mm,
            program_box_mm=seen.program_box_mm,
            arm=self._arm(),
        )

    def _arm(self) -> DrawnArm | None:
        if self.model is None or self.controller is None or not self.controller.joints_rad:
            return None
        arm, joints_rad = find_any_arm(self.model), np.array(self.controller.joints_rad)
        return DrawnArm(
            lengths_mm=lengths_mm(arm),
            joints_deg=tuple(map(degrees, self.controller.joints_rad)),
            skeleton_mm=tuple(skeleton_mm(arm, joints_rad) or ()),
        )

    async def take_model(self, text: str) -> AnswerFound:
        """Name of the arm; empty for one that is not listed."""
        self.model = find_any_arm(text).identifier if text else None
        return AnswerFound(answer=text, model=self.model, arm=self._arm())

    async def take_camera(self, text: str, look: bool = True) -> AnswerFound:
        """A camera's address: one picture is taken, and looked at."""
        self.camera = seen = await take_picture(text)
        if not look:
            return AnswerFound(answer=text)
        height, width = seen.image.shape[:2]
        looked = AnswerFound(answer=text)
        with suppress(DetectionError):  # a black picture: the next one says why
            looked = await self.look()
        who = ", ".join(filter(None, (seen.who, f"a picture of {width} x {height}")))
        return looked.model_copy(update={"answer": text, "found": (who, *looked.found), "size": (width, height)})

    async def look(self) -> AnswerFound:
        """The target that the last picture shows; none in it is no error."""
        from calibration.detection.recognition import recognise  # a daemon that is set up needs none

        assert self.camera is not None
        seen = await asyncio.to_thread(recognise, self.camera.image)
        if seen is None:
            return AnswerFound(found=("no target is recognised in it",))
        words = text_of_target(seen.target)
        found = await self.take_target(words)
        doubts = tuple(
            f"{doubt}: look again with the whole target in view, or type what it is" for doubt in seen.doubts
        )
        return found.model_copy(
            update={"found": (f"it shows {words}", *found.found), "doubts": doubts, "target": words}
        )

    async def take_setup(self, text: str) -> AnswerFound:
        self.setup = parse_setup(text)
        return AnswerFound(answer=text)

    async def take_target(self, text: str) -> AnswerFound:
        """A target in words, looked for in the last picture; empty: what another picture shows."""
        from calibration.detection.detect import detect

        if not text:
            assert self.camera is not None
            self.camera = await take_picture(self.camera.address)
            looked = await self.look()
            if looked.target is None:
                raise AnswerRefused("no target is recognised", "bring one whole into view, or type what it is")
            return looked.model_copy(update={"complete": False})
        self.target = target = target_of_text(text)
        _, second, what, second_what = EDGES[type(target)]
        lines = (f"to measure: {what}" + (f", and if you can {second_what}" if second else ""),)
        answer = AnswerFound(answer=text_of_target(target), found=lines, of=len(target.points_mm))
        if self.camera is None:
            return answer
        try:
            seen = await asyncio.to_thread(detect, self.camera.image, target)
        except DetectionError as error:
            return answer.model_copy(update={"doubts": (f"it is not found in the picture: {error}",)})
        points = zip(seen.ids.tolist(), seen.corners_px.tolist(), strict=True)
        return answer.model_copy(update={"corners": tuple((number, u, v) for number, (u, v) in points)})

    async def take_size(self, text: str) -> AnswerFound:
        """The target's size, and with what it was measured; with the accuracy to expect of it."""
        from daemon.tools.first_setup.expected import PICTURES, expected_mm

        assert self.target is not None and self.camera is not None
        self.size = size = parse_size(text, self.target)
        lengths = EDGES[type(self.target)][:2]
        found = tuple(f"{each} = {getattr(size.target, each):g}" for each in lengths if each)
        height, width = self.camera.image.shape[:2]
        self.expected_mm = await asyncio.to_thread(expected_mm, (width, height), self.setup, size)
        if self.expected_mm is None:
            far = "the whole target is in no picture from [calibration.limits] distance_mm, 450 to 750 mm"
            return AnswerFound(answer=text, found=found, doubts=(f"{far}: set others, or take a smaller target",))
        expected = f"expected with {PICTURES} pictures: ± {self.expected_mm:.2f} mm; less with a better arm"
        return AnswerFound(answer=text, found=(*found, expected), expected_mm=self.expected_mm)

    async def take_tolerance(self, text: str) -> AnswerFound:
        """The largest U, mm."""
        self.tolerance_mm = parse_tolerance(text)
        if self.expected_mm is None or self.expected_mm <= self.tolerance_mm:
            return AnswerFound(answer=text)
        doubt = f"± {self.expected_mm:.2f} mm is expected, which is more: take more pictures, or allow more"
        return AnswerFound(answer=text, doubts=(doubt,))

    async def take_box(self, text: str) -> AnswerFound:
        assert self.controller is not None
        self.controller = seen = await read_robot(self.controller)
        corners = [*self.corners, *parse_corners(text, seen.flange_mm, seen.program_box_mm)][-2:]
        self.corners = corners if len(corners) == 1 else []
        answer = " ".join(f"{value:g}" for corner in corners for value in corner)
        if self.corners:
            line = f"a corner at {answer}; now the opposite one"
            return AnswerFound(answer=answer, complete=False, found=(line,), arm=self._arm())
        self.box_mm = box_of(corners, seen.flange_mm)
        return AnswerFound(answer=answer, flange_mm=seen.flange_mm, arm=self._arm())


TAKES: dict[str, Callable[[Interview, str], Awaitable[AnswerFound]]] = {
    name: getattr(Interview, f"take_{name}") for name in QUESTIONS
}
