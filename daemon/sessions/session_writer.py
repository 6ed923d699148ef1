"""Write a session folder: pictures and poses are stored before use, so that `handeyed solve` reproduces the result."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np

from calibration.documents.arm_conditions import LoadDocument
from calibration.documents.external_axis import external_axes_of
from calibration.documents.pose import PoseDocument
from calibration.documents.session import SessionDocument, ViewDocument
from calibration.errors import DetectionError
from calibration.problem import Problem, View
from calibration.sentences.sentence import Sentence, with_fix
from daemon.cell.arm_in_cell import ArmInCell
from daemon.errors import PictureUnusable
from daemon.runtime.workers import Workers
from daemon.sessions.detections import DETECTIONS_FILE, DetectionDocument, DetectionsDocument, MissedDocument
from daemon.sessions.look import measure_quality
from daemon.sessions.session_files import SESSION_FILE, read_grey, read_levels
from daemon.sessions.session_reader import problem_of
from daemon.store.store import Store
from drivers.cameras.decoding import PNG_MAGIC
from drivers.cameras.pixel_depth import to_8_bit
from drivers.interfaces import CameraFrame, PoseReading

if TYPE_CHECKING:
    from calibration.planning.scene_belief import ScenePrior

FAST_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1)
"""Level 1: lossless as every level, several times faster and slightly larger."""


SAME_READING = 1e-3
"""mm, rad: an external axis that moved by less stands where it stood."""


class SensorBeside(Protocol):
    """A sensor that looks from the same stations."""

    async def look(self, reading: PoseReading, at: str) -> None:
        """Store what it sees from where the arm stands. Raises DaemonError, DeviceError."""
        ...


class SessionWriter:
    """Writes the session folder of one run, whose document begins as `head`, without views.

    `beside`: sensors that look after each picture, from the same pose. The load of `arm` is that of the session, its
    temperature that of each view.
    """

    def __init__(
        self, folder: Path, head: SessionDocument, store: Store, workers: Workers, arm: ArmInCell,
        beside: Sequence[SensorBeside] = (),
    ) -> None:  # fmt: skip
        self.folder = folder
        self._store, self._workers, self._arm, self._beside = store, workers, arm, beside
        self._image_size = head.camera.image_size if head.camera else None
        self._target_seen = False
        self._detections = DetectionsDocument()
        self._taken: dict[int, DetectionDocument] = {}
        load = arm.conditions().load
        carried = None if load is None else LoadDocument(**vars(load))
        self._document = head.model_copy(update={"load": carried})

    async def add(self, frame: CameraFrame, reading: PoseReading, at: str = "") -> int:
        """Store a station; returns the index. Raises PictureUnusable, StorageError, as the sensors beside."""
        self._require_size(frame)
        index = len(self._document.views)
        name = image_name(index)
        content = await self._workers.run(png_of, frame)
        await self._store.write_file(self.folder / name, [content])
        joints = None if reading.joints_rad is None else tuple(np.degrees(reading.joints_rad).round(6).tolist())
        pose = PoseDocument.of(reading.base_T_flange)
        axes = external_axes_of(reading.external_axes)
        temperature_c = None if frame.capture is None else frame.capture.temperature_c
        view = ViewDocument(
            base_T_flange=pose, joints_deg=joints, external_axes=axes, image=name, camera_temperature_c=temperature_c,
            arm_temperature_c=self._arm.conditions().temperature_c,
        )  # fmt: skip
        document = self._document.model_copy(update={"views": [*self._document.views, view]})
        await self._store.write_file(self.folder / SESSION_FILE, [document.model_dump_json(indent=1).encode()])
        self._document = document
        self._taken[index] = DetectionDocument(index=index, at=at, configuration=reading.posture)
        for sensor in self._beside:
            await sensor.look(reading, at)
        return index

    async def view(self, index: int) -> View:
        """Detect the target in a stored picture: the view with its detection, or with the reason why there is none.

        Until the target is found for the first time the reason may be that the pictures show another one.
        """
        view, sharpness = await self._workers.run(_detect_view, self.folder, self._document, index, self._target_seen)
        self._target_seen = self._target_seen or view.detection is not None
        seen, missing = view.detection, view.missing
        corners = [] if seen is None else zip(seen.ids.tolist(), seen.corners_px.round(3).tolist(), strict=True)
        self._detections = self._detections.with_view(self._taken[view.index].model_copy(update={
            "corners": tuple((point, u, v) for point, (u, v) in corners),
            "missing": None if missing is None else MissedDocument.of(*missing),
            "sharpness": round(sharpness, 4),
        }))  # fmt: skip
        await self._store.write_file(self.folder / DETECTIONS_FILE, [self._detections.model_dump_json().encode()])
        return view

    def problem(self, views: list[View]) -> Problem:
        """The solver's Problem, exactly as the folder describes it."""
        assert self._image_size is not None  # the first picture set it
        return problem_of(self._document, self._image_size, views)

    def problem_here(self, views: list[View]) -> Problem:
        """For planning: the problem as if its external axis had stood in every view where it stands in the last."""
        problem, here = self.problem(views), self._document.axis_reading(-1)
        if problem.external_axis is None or here is None:
            return problem
        return problem.with_axis_at_zero(replace(problem.external_axis, zero=here))

    def guess_here(self, guess: "ScenePrior") -> "ScenePrior":
        """What is stated of the scene, in the base where it stands in the last view."""
        axis, here = self._document.rough_axis, self._document.axis_reading(-1)
        return guess if axis is None or here is None else guess.at_reading(axis, here)

    def axis_moved_since(self, index: int, reading: PoseReading) -> bool:
        """Whether the external axis stood elsewhere in that view."""
        declared, then = self._document.external_axis, self._document.axis_reading(index)
        now = None if declared is None else declared.reading(external_axes_of(reading.external_axes))
        return then is not None and now is not None and abs(now - then) > SAME_READING

    def _require_size(self, frame: CameraFrame) -> None:
        size = (int(frame.image.shape[1]), int(frame.image.shape[0]))
        if self._image_size is None:
            self._image_size = size
        if size != self._image_size:
            given, wanted = ("{} x {}".format(*s) for s in (size, self._image_size))
            what = Sentence("picture-of-other-size", given=given, wanted=wanted)
            raise PictureUnusable(what, Sentence("set-resolution-back"))


def image_name(index: int) -> str:
    return f"view_{index:03d}.png"


def png_of(frame: CameraFrame) -> bytes:
    """The frame as PNG with every bit: the camera's file when it is one, else encoded. Raises PictureUnusable."""
    if frame.encoded is not None and frame.encoded.startswith(PNG_MAGIC):
        return frame.encoded
    try:
        done, content = cv2.imencode(".png", frame.image if frame.levels is None else frame.levels, FAST_PNG)
        why = "" if done else "imencode"
    except cv2.error as error:
        why = error.err
    if why:
        raise PictureUnusable(Sentence("picture-not-stored", why=why), Sentence("see-frame"))
    return bytes(np.asarray(content, np.uint8).data)


def _detect_view(folder: Path, document: SessionDocument, index: int, target_seen: bool) -> tuple[View, float]:
    """The view, and how sharp its picture is; see `look.measure_quality`."""
    from daemon.sessions.view_detection import detect_in_levels, explain_missing  # needed by runs only

    view = document.views[index]
    name = view.image or ""
    taken = View(
        index, view.stance, None, name, camera_temperature_c=view.camera_temperature_c,
        arm_temperature_c=view.arm_temperature_c,
    )  # fmt: skip
    target = document.described_target()
    levels = read_levels(folder / name)
    found = detect_in_levels(levels, target)
    seen = None if isinstance(found, DetectionError) else found.corners_px
    sharpness = measure_quality(to_8_bit(levels), seen).sharpness
    if isinstance(found, DetectionError):
        missed = replace(taken, missing=(found.code, with_fix(found.what, found.fix)))
        if not target_seen:
            missed = explain_missing([missed], target, lambda file: read_grey(folder / file))[0]
        return missed, sharpness
    return replace(taken, detection=found), sharpness
