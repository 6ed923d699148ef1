"""The check of the robot: state, frame, load, and how far what it carries reaches. Nothing moves."""

from collections.abc import Iterator

import numpy as np

from calibration.kinematics.abb_arms import find_any_arm
from calibration.kinematics.load import Load
from calibration.transforms import difference as pose_difference
from calibration.transforms import quaternion_from_rotation
from daemon.cell.cell import motion_obstacles
from daemon.cell.frame_check import frame_difference
from daemon.cell.readings import read_setup
from daemon.cli.output import CheckResult
from daemon.config.settings import RobotSettings, Settings
from drivers.errors import DeviceUnreachable, GarbledAnswer, RequestRefused
from drivers.interfaces import Robot, RobotSetup
from drivers.robots.base_frame import read_base_frame

MIN_LOAD_KG = 0.01
"""A load below this is the 1 gram of tool0: nobody measured it."""
MAX_FRAME_MM, MAX_FRAME_RAD = 1.0, np.radians(0.1)
"""Differences between the base frame of settings and controller that are named."""
IDENTIFY = (
    "identify it: mount camera and bracket, manual mode, motors on; pendant: Program Editor, Debug, Call Routine,"
    " LoadIdentify, tool load; write what it finds into cell_flange (CELL_shared.sys, or handeyed robot setup --set)"
)


async def check_robot(robot: Robot, settings: Settings) -> CheckResult:
    """Check state, frame and settings of the robot and its program. Raises DeviceError."""
    reasons = motion_obstacles(await robot.read_status())
    pose = await robot.read_pose()
    at = ", ".join(f"{value:.1f}" for value in pose.base_T_flange[:3, 3])
    if reasons:
        found = "; ".join(reasons)
        return CheckResult("robot", False, f"answers, but {found}", "put this right at the controller")
    frame_problem = await _base_frame_problem(robot, settings.robot)
    if frame_problem is not None:
        return CheckResult("robot", False, *frame_problem)
    if settings.robot.model is not None:
        difference = frame_difference(find_any_arm(settings.robot.model), await robot.read_joints(), pose)
        if not difference.agrees:
            return CheckResult("robot", False, difference.what, difference.fix)
    setup = await read_setup(robot)
    for what, fix in [] if setup is None else setup_problems(setup, settings.robot):
        return CheckResult("robot", False, what, fix)
    could = "could move" if robot.capabilities.moves else "is read only: pictures are taken by hand, with --manual"
    frame = robot.capabilities.pose_frame
    carries = "" if setup is None else f", carries {setup.load_kg:g} kg"
    stands = f"the flange stands at ({at}) mm in the {frame} frame{carries}"
    return CheckResult("robot", True, f"answers and {could}; {stands}")


async def _base_frame_problem(robot: Robot, settings: RobotSettings) -> tuple[str, str] | None:
    """A base frame of the controller, read over Robot Web Services, that the settings do not have; None without."""
    in_base = robot.capabilities.pose_frame == "base" and settings.base_frame is None
    try:
        world_T_base = None if in_base else await read_base_frame(robot)
    except (DeviceUnreachable, RequestRefused, GarbledAnswer):
        return None
    if world_T_base is None:
        return None
    ours = np.eye(4) if settings.world_T_base is None else settings.world_T_base
    off_mm, off_rad = pose_difference(ours, world_T_base)
    if off_mm <= MAX_FRAME_MM and off_rad <= MAX_FRAME_RAD:
        return None
    numbers = ", ".join(f"{value:.3f}" for value in world_T_base[:3, 3])
    turn = ", ".join(f"{value:.7f}" for value in quaternion_from_rotation(world_T_base[:3, :3]))
    return (
        f"the controller's base frame is {off_mm:.0f} mm and {np.degrees(off_rad):.1f} deg from [robot] base_frame",
        f"base_frame = {{ translation_mm = [{numbers}], quaternion_wxyz = [{turn}] }}",
    )


def setup_problems(setup: RobotSetup, robot: RobotSettings) -> Iterator[tuple[str, str]]:
    """What is wrong with the program's settings beside ours, each with its remedy."""
    if setup.load_kg < MIN_LOAD_KG:
        yield f"the load on the flange is the 1 gram of tool0 ({setup.load_kg:g} kg): the arm is not armed", IDENTIFY
    if robot.load is not None:
        off_mm = float(np.linalg.norm(np.subtract(setup.load_centre_mm, robot.load.centre_mm)))
        if not robot.load.load().is_as(Load(setup.load_kg, setup.load_centre_mm)):
            yield (
                f"the controller moves with a load of {setup.load_kg:g} kg; that of [robot.load] is"
                f" {robot.load.mass_kg:g} kg, and its centre {off_mm:.0f} mm away",
                f"correct one of them; {IDENTIFY}",
            )
    farthest_mm = float(np.linalg.norm(robot.points_mm, axis=-1).max())
    if farthest_mm > setup.reach_mm:
        yield (
            f"[robot] carried_mm has a point {farthest_mm:.0f} mm from the flange, cell_reach is {setup.reach_mm:g} mm:"
            " it would move faster than speed_mm_s when the flange turns",
            "raise cell_reach in CELL_shared.sys",
        )
    if robot.speed_mm_s > setup.speed_max_mm_s:
        yield (
            f"[robot] speed_mm_s is {robot.speed_mm_s:g}, and the controller allows {setup.speed_max_mm_s:g}",
            "lower it, or raise cell_speed_max in CELL_shared.sys",
        )
