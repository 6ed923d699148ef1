"""`handeyed robot jog`: turn the arm's axes over the CB link, for the first pose and for views by hand."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError, ExitStatus

if TYPE_CHECKING:
    from calibration.transforms import Array
    from daemon.config.settings import Settings
    from drivers.interfaces import ConfiguredRobot, Robot

MAX_CONNECT_S = 10.0
MAX_JOG_DEG = 30.0
"""Most that an axis turns in one jog; --to may turn farther, up to [robot] joint_travel_deg."""


def jog(
    file: Annotated[Path, typer.Argument(help="handeyed.toml")],
    axis: Annotated[int, typer.Option(min=1, max=6, help="The axis to turn.")] = 1,
    by: Annotated[float, typer.Option(metavar="DEG", min=-MAX_JOG_DEG, max=MAX_JOG_DEG, help="By how much.")] = 0.0,
    to: Annotated[str | None, typer.Option(metavar="DEGREES", help="Six axes to move to, as 0,20,10,0,60,0.")] = None,
    speed: Annotated[float, typer.Option(metavar="MM_S", min=1, max=250, help="Limit at flange and camera.")] = 50.0,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for consent.")] = False,
) -> None:
    """Turn one axis, or move all axes to their angles (MoveAbsJ: no posture, no singularity). The arm moves.

    The daemon must not be running: the controller serves one client. Nobody may be near the arm; this is no safety
    function. Ctrl-C stops the arm.

    Exit status: 0 it stands there, 1 it was refused or stopped, 2 the settings cannot be read.
    """
    import asyncio

    from daemon.config.settings import load_settings

    asyncio.run(_jog(load_settings(file), axis, by, to, speed, yes=yes))


async def _jog(settings: "Settings", axis: int, by: float, to: str | None, speed: float, *, yes: bool) -> None:
    import numpy as np

    from drivers.interfaces import JointGoal
    from drivers.registry import open_robot
    from drivers.robots.base_frame import configured

    robot = open_robot(settings.robot.address, world_T_base=settings.robot.world_T_base)
    try:
        await _connect(robot)
        program = configured(robot)
        if program is None:
            raise CommandError(settings.robot.address, "axes are moved over the CB link only", "write tcp://HOST:4242")
        here = await robot.read_joints()
        goal = _goal(here, axis, by, to)
        _check(settings, here, goal)
        shown = ", ".join(f"{angle:.2f}" for angle in np.degrees(goal))
        if not (yes or typer.confirm(f"Move the axes to {shown} deg at {speed:g} mm/s?", default=False, err=True)):
            raise CommandError(settings.robot.address, "nothing moved", "consent to it, or give --yes")
        axes = (await robot.read_pose()).external_axes
        await _move(robot, program, JointGoal(goal, axes, speed))
        typer.echo(
            f"the axes stand at {', '.join(f'{angle:.2f}' for angle in np.degrees(await robot.read_joints()))} deg"
        )
    finally:
        await robot.close()


async def _connect(robot: "Robot") -> None:
    import asyncio

    from drivers.errors import DeviceUnreachable

    ends_s = asyncio.get_running_loop().time() + MAX_CONNECT_S
    while not robot.link.connected:
        if asyncio.get_running_loop().time() > ends_s:
            raise DeviceUnreachable(
                "robot", robot.link.detail, "see that no daemon runs, and that the controller is on"
            )
        await asyncio.sleep(0.05)


async def _move(robot: "Robot", program: "ConfiguredRobot", goal: object) -> None:
    from drivers.interfaces import JointGoal

    assert isinstance(goal, JointGoal)
    await robot.set_armed(True)
    try:
        await program.move_to_joints(goal)
    finally:
        await robot.stop_and_disarm()


def _goal(here: "Array", axis: int, by: float, to: str | None) -> "Array":
    """Joints (6,) in rad. Raises CommandError for text that is not six angles."""
    import numpy as np

    goal = here.copy()
    if to is None:
        goal[axis - 1] += np.radians(by)
        return goal
    try:
        angles = [float(each) for each in to.split(",")]
    except ValueError:
        angles = []
    if len(angles) != len(goal) or not np.all(np.isfinite(angles)):
        raise CommandError("--to", f"{to!r} is not six angles", "write --to 0,20,10,0,60,0", ExitStatus.UNREADABLE)
    return np.radians(angles)


def _check(settings: "Settings", here: "Array", goal: "Array") -> None:
    """Check joint travel, and for a known arm its limits and its path in the box. Raises CommandError, PathRefused."""
    import numpy as np

    from calibration.kinematics.arm import UnreachablePoseError
    from daemon.cell.motion_rules import MotionRules

    travel_deg = float(np.degrees(np.abs(goal - here).max()))
    if travel_deg > settings.robot.joint_travel_deg:
        what = f"an axis would turn by {travel_deg:.0f} deg (limit {settings.robot.joint_travel_deg:g})"
        raise CommandError("--to", what, "go there in steps, or raise [robot] joint_travel_deg")
    rules = MotionRules.of(settings.robot)
    if rules.arm is None:
        return
    try:
        rules.arm.require_within_limits(goal)
    except UnreachablePoseError as error:
        raise CommandError("--to", error.what, error.fix) from None
    rules.check_joint_move(here, goal)
