"""Writes session.json or scan.json beside its pictures or clouds, which are linked, or copied where that fails.

And says in words what was understood of a folder.
"""

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from calibration.documents.imports.pairing import shown
from calibration.documents.imports.refusal import refusal
from calibration.documents.pose import PoseDocument
from calibration.documents.session import SessionDocument
from calibration.documents.target import described
from calibration.documents.validation import validate_document
from calibration.transforms import Array
from daemon.sessions.session_files import SESSION_FILE
from daemon.sessions.session_import.request import Understood, are_clouds, views_of
from registration.scan_folder import ScanDocument

SCAN_FILE = "scan.json"


def write_session(understood: Understood, folder: Path) -> Path:
    """session.json or scan.json in a new or empty folder. Raises DocumentError."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise refusal(str(folder), "--out", "not an empty folder", "name a new one", "import")
    names = _names(understood.images)
    document = _document(understood, names)
    validate_document(ScanDocument if understood.is_scan else SessionDocument, document, str(folder))
    file = folder / (SCAN_FILE if understood.is_scan else SESSION_FILE)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for image, name in zip(understood.images, names, strict=True):
            _place(image, folder / name)
        file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise refusal(str(folder), "--out", f"cannot be written ({reason})", "choose another", "import") from None
    return file


def _place(image: Path, place: Path) -> None:
    try:
        os.link(image, place, follow_symlinks=False)
    except OSError:
        shutil.copyfile(image, place, follow_symlinks=False)


def _names(images: Sequence[Path]) -> list[str]:
    """The pictures' own names; numbered ones where two are called alike."""
    own = [image.name for image in images]
    if len({name.lower() for name in own}) == len(own):
        return own
    return [f"view_{at:03}{image.suffix.lower()}" for at, image in enumerate(images)]


def _document(understood: Understood, names: Sequence[str]) -> dict[str, Any]:
    request, views = understood.request, list[dict[str, Any]]()
    axes, unit = understood.imported.poses.external_axes, request.cloud_unit or understood.imported.cloud_unit
    sights = views_of(understood.camera_T_target, [*map(Path, names)], unit, request)
    if understood.camera_points_mm is not None:
        sights = [{"camera_point_mm": point} for point in understood.camera_points_mm.tolist()]
    for at, (pose, sight) in enumerate(zip(understood.base_T_flange, sights, strict=True)):
        view: dict[str, Any] = {"base_T_flange": PoseDocument.of(pose).model_dump(mode="json")}
        if axes is not None and np.any(np.isfinite(axes)):
            view["external_axes"] = [float(one) if np.isfinite(one) else None for one in axes[at]]
        views.append(view | sight)
    document: dict[str, Any] = {
        "schema_version": 1,
        "source": f"{understood.imported.kind}: {understood.request.folder.resolve().name}",
        "setup": understood.reading.setup,
    }
    if (of := understood.imported.poses.poses_of) is not None and not understood.is_scan:
        document["poses_of"] = {end: name[:200] for end, name in asdict(of).items()}
    if understood.target is not None:
        document["target"] = described(understood.target)
    if understood.images and not are_clouds(understood.images):
        document["camera"] = None if understood.camera is None else understood.camera.model_dump(mode="json")
    if (axis := understood.decision.axis) is not None:
        point_mm = None if axis.kind == "track" else axis.point_mm.round(3).tolist()
        beside = {"kind": axis.kind, "number": axis.number, "direction": axis.direction.tolist(), "point_mm": point_mm}
        document["external_axis"] = beside
    return document | {"views": views}


BASE_AXES = ("forward (x)", "to the left (y)", "up (z)")
OPPOSITE = ("backward (-x)", "to the right (-y)", "down (-z)")


def report(understood: Understood, file: Path) -> str:
    """One line for each thing, the first pose in words, and what to do next."""
    table, reading = understood.imported.poses, understood.reading
    views = len(understood.base_T_flange)
    seen = f"the camera's {'point' if understood.camera_points_mm is not None else 'pose'}"
    images = [image.name for image in understood.images] or [seen] * views
    pairs = [f"{image} - {label}" for image, label in zip(images, table.labels, strict=True)]
    lines = [
        f"{understood.request.folder}: {understood.imported.kind}",
        f"poses        {views}, {table.layout}",
        f"convention   {reading.convention.words}, in {reading.unit}, {reading.frame}, {reading.setup}",
        f"evidence     {understood.decision.words or 'none: the files and options state everything'}",
        f"pairs        {understood.imported.pairing}: {shown(pairs)}",
    ]
    if understood.target is not None:
        settings = described(understood.target)
        lines.append(f"target       {', '.join(f'{key} {value}' for key, value in settings.items())}")
    if understood.camera is not None:
        (fx, _, cx), (_, fy, cy), _ = understood.camera.matrix
        lens = understood.camera.lens if any(understood.camera.distortion) else "no distortion"
        lines.append(f"camera       given: f {fx:.1f}, {fy:.1f}, centre {cx:.1f}, {cy:.1f} px, {lens}")
    elif understood.images and not understood.is_scan:
        lines.append("camera       not given: the intrinsics will be estimated")
    lines += [f"note         {note}" for note in understood.notes]
    if table.kind != "points":
        lines.append(f"first pose   {first_pose(understood.base_T_flange[0])}")
    command = f"handeyed register {file.parent} --calibration calibration.json --out cloud.ply"
    lines.append(f"written      {file}; next: " + (command if understood.is_scan else f"handeyed solve {file.parent}"))
    return "\n".join(lines)


def first_pose(base_T_flange: Array) -> str:
    """Where the flange is and where its axes point, such as "x 812.4, y -35.1, z 640.0 mm; z points down (-z)"."""
    x, y, z = base_T_flange[:3, 3]
    axes = " and ".join(f"its {name} points {_direction(base_T_flange[:3, at])}" for at, name in ((2, "z"), (0, "x")))
    return f"the flange is at x {x:.1f}, y {y:.1f}, z {z:.1f} mm in the base; {axes}"


def _direction(axis: Array) -> str:
    nearest = int(np.abs(axis).argmax())
    words = (BASE_AXES if axis[nearest] > 0 else OPPOSITE)[nearest]
    off = float(np.degrees(np.arccos(np.clip(abs(axis[nearest]), 0, 1))))
    return words if off < 0.5 else f"{words}, {off:.0f} degrees off"
