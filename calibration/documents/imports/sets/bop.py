"""BOP: scene_camera.json (cam_K, cam_R_w2c, cam_t_w2c in mm) and scene_gt.json, with rgb/ or gray/ beside.

Source: bop_toolkit, docs/bop_datasets_format.md. The world is the base: the camera's pose there is taken as the
flange's, so that X of a set whose poses are right is the identity.
"""

import numpy as np

from calibration.documents.imports.conventions import CONVENTIONS
from calibration.documents.imports.intrinsics import intrinsics_of
from calibration.documents.imports.pairing import natural, pair
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.records import array_of
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import PICTURES, Files, ImportedSet, of_suffix
from calibration.documents.imports.trees import read_json

CAMERA, TRUTH = "scene_camera.json", "scene_gt.json"


def recognise(files: Files) -> bool:
    """Whether there is a scene_camera.json."""
    return any(name.rsplit("/", 1)[-1] == CAMERA for name in files.names)


def read(files: Files, part: str | None) -> ImportedSet:
    """One scene; `part` names its folder. Raises DocumentError."""
    scenes = [name.removesuffix(CAMERA) for name in files.names if name.rsplit("/", 1)[-1] == CAMERA]
    scene = f"{part.strip('/')}/" if part else scenes[0] if len(scenes) == 1 else None
    if scene not in scenes:
        what = f"{len(scenes)} scenes ({', '.join(scenes[:6])})"
        raise refusal(files.origin, "--part", what, "name one: --part 000001", "bop")
    origin = f"{scene}{CAMERA}"
    data = read_json(files.read(origin), origin)
    frames = sorted(data, key=natural) if isinstance(data, dict) else []
    poses = _table(origin, frames, data, "cam_R_w2c", "cam_t_w2c")
    images = of_suffix([name for name in files.names if name.startswith(scene)], PICTURES)
    colour = [name for name in images if name[len(scene) :].split("/")[0] in ("rgb", "gray", "grey")]
    paired = pair(colour, poses)
    return ImportedSet(
        "BOP", poses.take(paired.rows), paired.images, paired.words, camera=intrinsics_of(data[frames[0]], origin),
        setup="eye-in-hand", notes=("the camera's pose in the world is taken as the flange's in the base",),
    )  # fmt: skip


def _table(origin: str, frames: list[str], data: dict[str, dict[str, object]], turn: str, length: str) -> PoseTable:
    """camera_T_world, whose inverse is the camera in the world."""
    rotations, translations = [], []
    for frame in frames:
        record = data[frame] if isinstance(data[frame], dict) else {}
        rotation, translation = array_of(record.get(turn)), array_of(record.get(length))
        if rotation is None or translation is None or rotation.size != 9 or translation.size != 3:
            fix = "only sets with poses of the camera in a world can be used"
            raise refusal(origin, frame, f"no {turn} and {length}", fix, "bop")
        rotations.append(rotation.reshape(9))
        translations.append(translation.reshape(3))
    return PoseTable(
        origin, tuple(frames), np.array(translations).reshape(-1, 3), np.array(rotations).reshape(-1, 9), "matrix",
        f"{turn} and {length}", CONVENTIONS["matrix"], unit="mm", frame="flange_T_base",
    ).checked()  # fmt: skip
