"""`python -m benchmarks.hand_eye.expected`: what accuracy to expect, by camera, arm, target and number of pictures.

U (k = 2, mm) at the worst of the points of the working volume, as `handeyed plan` predicts it of planned poses. Nothing
is measured: `hand_eye.belief` compares such predictions with what sessions then have.
"""

from itertools import product
from typing import Any

import handeyed

PICTURES = (4, 6, 8, 12)
CAMERAS = {"0.3 MP": (640, 480, 900.0), "2.3 MP": (1920, 1200, 1900.0), "5 MP": (2448, 2048, 2400.0)}
"""Width and height in px, focal length in px."""

ARMS = {"0.02 mm, 0.002 deg": (0.02, 0.002), "0.05 mm, 0.005 deg": (0.05, 0.005), "0.2 mm, 0.02 deg": (0.2, 0.02)}
"""One standard deviation of the flange's reported pose."""

TARGETS = {
    "printed": {"source": "printed"},
    "measured": {"source": "measured", "length_mm": 198.0, "instrument": "calliper"},
}


def question(camera: str, arm: str, target: str, pictures: int) -> dict[str, Any]:
    """plan.json of the A4 board that `handeyed target charuco` prints, 450 to 750 mm away."""
    width, height, focal = CAMERAS[camera]
    translation_mm, rotation_deg = ARMS[arm]
    return {
        "schema_version": 1,
        "target": {"kind": "charuco", "columns": 7, "rows": 9, "square_mm": 22.0, "marker_mm": 16.5,
                   "dictionary": "DICT_5X5_100"},
        "camera": {"matrix": [[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]],
                   "distortion": [0.0] * 5, "image_size": [width, height]},
        "flange_T_camera_guess": {"translation_mm": [35.0, -20.0, 90.0], "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0]},
        "base_T_target_guess": {"translation_mm": [900.0, 50.0, 100.0], "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0]},
        "noise": {"image_px": 0.05, "robot_translation_mm": translation_mm, "robot_rotation_deg": rotation_deg},
        "known": {"target": TARGETS[target]},
        "poses": pictures,
    }  # fmt: skip


def main() -> None:
    """Print the table."""
    heads = "".join(f"{count:8}" for count in PICTURES)
    print(f"{'camera':8}{'arm, one sigma':20}{'target':8}{heads} pictures")
    for camera, arm, target in product(CAMERAS, ARMS, TARGETS):
        found = [handeyed.plan(question(camera, arm, target, count)).predicted.expanded_mm for count in PICTURES]
        values = "".join("       -" if u is None else f"{u:8.2f}" for u in found)
        print(f"{camera:8}{arm:20}{target:8}{values}")


if __name__ == "__main__":
    main()
