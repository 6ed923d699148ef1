"""Settings with poses as an operator would teach them: every run moves the same way, so that runs can be compared."""

import json
from typing import Any

from tests.stories.plant import poses_taught_for


def add_taught_poses(settings: str, seed: int) -> str:
    """The handeyed.toml of the mock cell of that seed, with eight poses in [calibration]."""
    poses = json.dumps([pose.model_dump(mode="json", exclude_none=True) for pose in poses_taught_for(seed)])
    return settings.replace("[calibration]\n", f"[calibration]\nposes = {_inline(json.loads(poses))}\n")


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + " }"
    return "[" + ", ".join(map(_inline, value)) + "]" if isinstance(value, list) else json.dumps(value)
