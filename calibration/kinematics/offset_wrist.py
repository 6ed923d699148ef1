"""Kinematics of a 6-axis arm whose axis 6 passes axis 4 at a distance, as ABB's GoFa.

Pieper's decoupling needs axes 4, 5 and 6 through one point. Here axes 4 and 5 meet, and that point lies on a circle
about axis 6. For a given angle of axis 6 it is known, and the closed form gives axes 1 to 3; the angle is right where
axis 5 then comes out perpendicular to axis 4, one equation in one unknown. Its roots are all postures, 16 at most (E.
J. F. Primrose, "On the input-output equation of the general 7R-mechanism", Mech. Mach. Theory 21, 1986).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.kinematics.arm import SINGULAR_EXACT, TOOL0_IN_AXIS_6, Arm, checked_joints, checked_poses
from calibration.kinematics.axis_rotations import wrap
from calibration.transforms import Array

SAMPLES = 144
"""Angles of axis 6 at which the equation is evaluated first, one every 2.5 deg."""

HALVINGS = 56
"""Of an interval of 2.5 deg: below the resolution of an angle."""

RIDDERS_STEPS = 14
"""Of C. Ridders' method (IEEE Trans. Circuits Syst. 26, 1979), which doubles the digits in each."""

GOLDEN, GOLDEN_STEPS = (5**0.5 - 1) / 2, 24
"""Golden section of two such intervals, to a millionth of a degree."""

TOWARDS_AN_EDGE = 1.0 - np.linspace(1.0, 0.0, 9) ** 2
"""Parts of an interval at whose end the reach ends, where the error changes with the root of the distance."""

Intervals = tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]
"""Pose, branch, and both ends (k,) of axis 6 in rad."""


@dataclass(frozen=True)
class OffsetWristArm(Arm):
    """As Arm; with all joints at zero axis 6 runs `wrist_offset_mm` above axis 4."""

    wrist_offset_mm: float = 0.0

    @property
    def reach_mm(self) -> float:
        """As in the arm's name: from axis 1 to axis 6, the arm stretched."""
        straight = np.hypot(self.forearm_mm, self.elbow_up_mm + self.wrist_offset_mm)
        return self.shoulder_forward_mm + self.lower_arm_mm + float(straight)

    def branches(
        self, base_T_flange: ArrayLike, near_rad: ArrayLike | None = None, singular: float = SINGULAR_EXACT
    ) -> Array:
        """All solutions (..., 8 k, 6) of poses (..., 4, 4), angles in (-pi, pi]; row modulo 8 is cfx, the rest NaN.

        Joint limits are ignored. Where the meeting point of axes 4 and 5 lies on axis 1, axis 1 is taken from
        `near_rad`; `singular` has no meaning here, since axes 4 and 6 are never in line.
        """
        pose = checked_poses(base_T_flange)
        poses = pose.reshape(-1, 4, 4)
        near = np.zeros(6) if near_rad is None else checked_joints(near_rad)
        near = np.broadcast_to(near, (*pose.shape[:-2], 6)).reshape(-1, 6)
        which, branch, axis_6 = self._roots(poses, near)
        joints = self._joints_at(poses[which], near[which], branch, axis_6)
        cfx = (self._sides(joints) < 0) @ np.array([4, 2, 1])
        order = np.argsort(8 * which + cfx, kind="stable")
        row = (8 * which + cfx)[order]
        rank = np.arange(len(row)) - np.searchsorted(row, row)
        found = np.full((len(poses), int(rank.max(initial=0)) + 1, 8, 6), np.nan)
        found[which[order], rank, cfx[order]] = joints[order]
        return found.reshape(*pose.shape[:-2], -1, 6)

    def singularity_clearance(self, joints_rad: ArrayLike) -> Array:
        """As Arm's; of the wrist what axes 1 to 3 cannot do in place of axis 6: |axis 5 sine| for no offset."""
        q = checked_joints(joints_rad)
        points, turned = self.skeleton(q), self._wrist_rotation(q)
        shoulder, elbow, wrist = (points[..., place, :] / self.reach_mm for place in (0, 1, 2))
        across = np.stack([-np.sin(q[..., 0]), np.cos(q[..., 0]), np.zeros_like(q[..., 0])], -1)
        upright = np.broadcast_to([0.0, 0.0, 1.0], across.shape)
        turns = np.stack([upright, across, across], -1)
        arms = np.stack([wrist, wrist - shoulder, wrist - elbow], -1)
        moves = np.cross(turns, arms, axis=-2)
        by_axis_6 = np.cross(turned[..., 0], -self.wrist_offset_mm / self.reach_mm * turned[..., 2])
        sides = np.abs(self._sides(q))
        regular = sides[..., :2].min(-1) > 1e-6
        instead = np.linalg.solve(np.where(regular[..., None, None], moves, np.eye(3)), by_axis_6[..., None])[..., 0]
        rest = turned[..., 0] - np.einsum("...ij,...j->...i", turns, instead)
        axis_4 = turned @ np.stack([np.cos(q[..., 4]), np.zeros_like(q[..., 4]), np.sin(q[..., 4])], -1)[..., None]
        free = np.abs(np.einsum("...i,...i->...", np.cross(axis_4[..., 0], turned[..., 1]), rest))
        clearance: Array = np.minimum(sides[..., :2].min(-1), np.where(regular, np.minimum(free, 1.0), 0.0))
        return clearance

    def _wrist_centres(self, base_T_flange: Array) -> Array:
        axis_6 = np.linspace(-np.pi, np.pi, SAMPLES, endpoint=False)
        centres: Array = self._meeting_point(base_T_flange[None], axis_6[None])[0]
        return centres

    def _meeting_point(self, poses: Array, axis_6: Array) -> Array:
        """Where axes 4 and 5 meet (n, s, 3) mm, for poses (n, 4, 4) and angles (n, s) of axis 6."""
        tool = poses[:, None, :3, :3] @ TOOL0_IN_AXIS_6.T
        up = np.sin(axis_6)[..., None] * tool[..., 1] + np.cos(axis_6)[..., None] * tool[..., 2]
        point: Array = poses[:, None, :3, 3] - self.flange_mm * tool[..., 0] - self.wrist_offset_mm * up
        return point

    def _errors(self, poses: Array, near: Array, axis_6: Array) -> Array:
        """Cosine (n, s, 4) between axes 4 and 5, for the four postures of axes 1 to 3; NaN out of reach."""
        tool = poses[:, None, :3, :3] @ TOOL0_IN_AXIS_6.T
        across = np.cos(axis_6)[..., None] * tool[..., 1] - np.sin(axis_6)[..., None] * tool[..., 2]
        q1, q2, q3 = self._positioning(self._meeting_point(poses, axis_6), near[:, None])
        bend = (q2 + q3)[..., ::2]
        ahead = np.stack([np.cos(q1[..., ::2]) * np.cos(bend), np.sin(q1[..., ::2]) * np.cos(bend), -np.sin(bend)], -1)
        errors: Array = np.einsum("nsbi,nsi->nsb", ahead, across)
        return errors

    def _roots(self, poses: Array, near: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
        """Pose, branch (0..3) and axis 6 of every root (k,)."""
        which, branch, low, high = self._intervals(poses, near)

        if not len(which):
            return which, branch, low

        def error(axis_6: Array) -> Array:
            found: Array = self._of_branch(poses[which], near[which], branch, axis_6[:, None])[:, 0]
            return found

        at_low, at_high = error(low), error(high)
        for _ in range(RIDDERS_STEPS):
            middle = (low + high) / 2
            at_middle = error(middle)
            slope = np.sqrt(at_middle**2 - at_low * at_high)
            part = np.divide(at_middle, slope, out=np.zeros_like(slope), where=slope > 0)
            better = middle + (middle - low) * np.sign(at_low - at_high) * part
            at_better = error(better)
            ends = np.stack([low, middle, better, high])
            values = np.stack([at_low, at_middle, at_better, at_high])
            order = np.argsort(ends, axis=0, kind="stable")
            ends, values = np.take_along_axis(ends, order, 0), np.take_along_axis(values, order, 0)
            first = (values[:-1] * values[1:] <= 0).argmax(axis=0)[None]
            low, high = (np.take_along_axis(ends, first + side, 0)[0] for side in (0, 1))
            at_low, at_high = (np.take_along_axis(values, first + side, 0)[0] for side in (0, 1))
        return which, branch, np.where(np.abs(at_low) <= np.abs(at_high), low, high)

    def _intervals(self, poses: Array, near: Array) -> Intervals:
        """Intervals of axis 6 with one root each: at and between samples, up to the reach, beside an extremum."""
        angles = np.linspace(-np.pi, np.pi, SAMPLES + 1)
        grid = np.broadcast_to(angles, (len(poses), SAMPLES + 1))
        errors = self._errors(poses, near, grid)
        before, after = errors[:, :-1], errors[:, 1:]
        which, place, branch = np.nonzero(before * after < 0)
        found: list[Intervals] = [(which, branch, angles[place], angles[place + 1])]
        which, place, branch = np.nonzero(errors == 0)  # as of axis 6 at 0 or 90 deg
        found.append((which, branch, angles[place], angles[place]))
        found.append(self._up_to_the_reach(poses, near, angles, errors))
        found.append(self._beside_extrema(poses, near, angles, errors))
        pose, of_branch, low, high = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return pose, of_branch, low, high

    def _up_to_the_reach(self, poses: Array, near: Array, angles: Array, errors: Array) -> Intervals:
        """Intervals with a root between the last sample within reach and the end of the reach."""
        finite = np.isfinite(errors)
        which, place, branch = np.nonzero(finite[:, :-1] != finite[:, 1:])
        first = finite[which, place, branch]
        inside, outside = angles[place + ~first], angles[place + first]
        edge = inside
        for _ in range(HALVINGS):
            middle = (edge + outside) / 2
            within = np.isfinite(self._of_branch(poses[which], near[which], branch, middle[:, None])[:, 0])
            edge, outside = np.where(within, middle, edge), np.where(within, outside, middle)
        finer = inside[:, None] + (edge - inside)[:, None] * TOWARDS_AN_EDGE
        values = self._of_branch(poses[which], near[which], branch, finer)
        row, step = np.nonzero(values[:, :-1] * values[:, 1:] < 0)
        return which[row], branch[row], finer[row, step], finer[row, step + 1]

    def _beside_extrema(self, poses: Array, near: Array, angles: Array, errors: Array) -> Intervals:
        """Two intervals for each extremum between samples of one sign, at which the error has the other sign."""
        left, here, right = errors[:, :-2], errors[:, 1:-1], errors[:, 2:]
        smallest = (np.abs(here) <= np.abs(left)) & (np.abs(here) <= np.abs(right))
        which, place, branch = np.nonzero(smallest & (left * here > 0) & (here * right > 0))
        value, step = here[which, place, branch], angles[1] - angles[0]
        low, high = angles[place + 1] - step, angles[place + 1] + step
        for _ in range(GOLDEN_STEPS):
            inner = np.stack([high - GOLDEN * (high - low), low + GOLDEN * (high - low)], -1)
            sizes = np.sign(value)[:, None] * self._of_branch(poses[which], near[which], branch, inner)
            left_is_less = sizes[:, 0] < sizes[:, 1]
            low, high = np.where(left_is_less, low, inner[:, 0]), np.where(left_is_less, inner[:, 1], high)
        extremum = (low + high) / 2
        found = self._of_branch(poses[which], near[which], branch, extremum[:, None])[:, 0]
        crossed = value * found < 0
        which, branch, extremum = which[crossed], branch[crossed], extremum[crossed]
        before, after = angles[place[crossed]], angles[place[crossed] + 2]
        ends = np.concatenate([before, extremum]), np.concatenate([extremum, after])
        return np.tile(which, 2), np.tile(branch, 2), *ends

    def _of_branch(self, poses: Array, near: Array, branch: NDArray[np.intp], axis_6: Array) -> Array:
        """`_errors` (k, s) of one branch each."""
        found: Array = self._errors(poses, near, axis_6)[np.arange(len(branch)), :, branch]
        return found

    def _joints_at(self, poses: Array, near: Array, branch: NDArray[np.intp], axis_6: Array) -> Array:
        """Joints (k, 6) of roots (k,)."""
        rows = np.arange(len(branch))
        positions = self._positioning(self._meeting_point(poses, axis_6[:, None]), near[:, None])
        q1, q2, q3 = (angles[rows, 0, 2 * branch] for angles in positions)
        zeros = np.zeros_like(q1)
        base_R_forearm = self._wrist_rotation(np.stack([q1, q2, q3, zeros, zeros, zeros], -1))
        tool = poses[:, :3, :3] @ TOOL0_IN_AXIS_6.T
        c, s = np.cos(axis_6)[:, None], np.sin(axis_6)[:, None]
        wrist = np.stack([tool[..., 0], c * tool[..., 1] - s * tool[..., 2], s * tool[..., 1] + c * tool[..., 2]], -1)
        m = np.swapaxes(base_R_forearm, -1, -2) @ wrist  # Rx(q4) Ry(q5)
        q4, q5 = np.arctan2(m[..., 2, 1], m[..., 1, 1]), np.arctan2(m[..., 0, 2], m[..., 0, 0])
        return wrap(np.stack([q1, q2, q3, q4, q5, axis_6], -1))
