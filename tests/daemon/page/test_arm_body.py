"""The arm that the page draws: its flange is where the daemon says it is, for every listed arm that is drawn so."""

import asyncio
import json
from pathlib import Path

import numpy as np

from calibration.kinematics.abb_arms import ARMS
from daemon.api.schemas.cell import ArmDocument
from daemon.page import FOLDER
from tests.daemon.cell_under_test import settings_for

POSES = 5
DRAW = """
import { armBody, isDrawable } from 'SCENE/arm_body.js';
let text = '';
for await (const chunk of process.stdin) text += chunk;
const drawn = JSON.parse(text).map(({ lengths_mm, poses_deg }) => {
  if (!isDrawable(lengths_mm)) return null;
  const { tool, pose } = armBody(lengths_mm, [0x6c7680, 0xd3d8dc]);
  return poses_deg.map((joints_deg) => {
    pose(joints_deg);
    return [...tool.matrixWorld.elements];
  });
});
process.stdout.write(JSON.stringify(drawn));
"""


async def test_the_flange_of_the_arm_drawn_is_the_flange_of_the_robot(node: str, tmp_path: Path) -> None:
    rng, arms, settings = np.random.default_rng(3), list(ARMS.values()), settings_for(tmp_path)
    joints = [rng.uniform(arm.lower_rad, arm.upper_rad, (POSES, 6)) for arm in arms]
    asked = [
        {"lengths_mm": ArmDocument.of_settings(settings, arm, True).lengths_mm, "poses_deg": np.degrees(each).tolist()}
        for arm, each in zip(arms, joints, strict=True)
    ]
    script = DRAW.replace("SCENE", (FOLDER / "scene").as_uri())
    pipe = asyncio.subprocess.PIPE
    command = (node, "--input-type=module", "-e", script)
    run = await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe, stderr=pipe)
    output, errors = await run.communicate(json.dumps(asked).encode())
    assert run.returncode == 0, errors.decode()
    drawn = json.loads(output)
    assert [each is None for each in drawn] == [arm.wrist_offset_mm != 0 for arm in arms]
    for arm, at, found in zip(arms, joints, drawn, strict=True):
        if found is not None:
            poses = np.reshape(found, (POSES, 4, 4)).transpose(0, 2, 1)
            assert np.abs(poses[:, :3, 3] - arm.forward(at)[:, :3, 3]).max() < 1e-3, arm.name
            assert np.abs(poses[:, :3, :3] - arm.forward(at)[:, :3, :3]).max() < 1e-6, arm.name
