"""What was understood of a folder, in words: the sentences that `handeyed import` prints."""

from pathlib import Path

import numpy as np

from calibration.documents.imports.pairing import shown
from calibration.documents.target import described
from calibration.transforms import Array
from daemon.sessions.session_import.request import Understood

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
