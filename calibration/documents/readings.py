"""Which convention robot poses are in, by the evidence of the images: every one is tried, the fits are compared.

A reading is one way to take the numbers: convention, unit, frame, and where the camera is. Two readings that give the
same equations are not distinguished by any data: poses of the flange in the base with the camera on it are the
inverted poses with the camera beside the robot.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from calibration.closed_forms.observability import require_observable
from calibration.closed_forms.registry import park
from calibration.diagnosis.angle_agreement import angles_between, angles_between_images, mean_mismatch_rad
from calibration.diagnosis.diagnose import MIN_LOG_LIKELIHOOD_GAIN, MIN_VIEWS, evenly_spaced
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fits
from calibration.diagnosis.hypothesis import few_views_factor
from calibration.documents.imports.pose_table import MIN_ARM_MM, PoseTable
from calibration.errors import GeometryError, UndeterminedError
from calibration.kinematics.conventions import LENGTH_UNITS, MM, Convention, Frame, LengthUnit
from calibration.kinematics.external_axis import AxisKind, ExternalAxis
from calibration.kinematics.robot_accuracy import MAX_POSSIBLE_NOISE
from calibration.problem import Setup, anchor_T_mount_of
from calibration.transforms import Array

MAX_COMPARED_VIEWS = 40
"""Views by which the readings are compared."""

SAME_POSE = 1e-6
"""Largest difference of the elements of poses that are the same under two readings; of lengths per mm of arm."""

BATCH = 40
"""Readings fitted together."""

MAX_SIZE_RATIO = 10.0
"""Largest ratio of the target's true lengths to those that are given, or the reverse, that is looked for."""

SIZE_STEP, FINE_SIZE_STEP = 1.05, 1.002
"""Ratios of neighbouring sizes that are tried: all, then around the best."""

MIN_RESIZED_MM = 1.0
"""Disagreement of robot and images, mm, from which on other sizes are tried: robots err by less."""

DOUBTFUL_SHARE = 1 / 3
"""Of the largest possible noise of a robot: 5 mm, 0.5 degrees."""

MAX_TURN_RAD, MORE_TURN_RAD, MAX_TURNED = float(np.radians(0.5)), float(np.radians(0.05)), 4
"""Mean difference of the angles between views up to which rotations agree; how much more others may differ, which are
tried as well; most of them."""

MAX_MOVED, MIN_RIGHT_SHARE = 2, 0.75
"""Views by which pictures and poses may be moved against each other, and the share of pairs that are right, where wrong
pairs are looked for."""

MAX_RESIZED_READINGS = 3
"""Likeliest readings with which other sizes of the target are tried."""


@dataclass(frozen=True)
class Reading:
    """One way to take the numbers of a table."""

    setup: Setup
    convention: Convention
    unit: LengthUnit
    frame: Frame

    @property
    def words(self) -> str:
        return f"{self.convention.name}, {self.unit}, {self.frame}, {self.setup}"


@dataclass(frozen=True, eq=False)
class Compared:
    """Readings with the same equations, and the fit of the images to them; None without images to compare."""

    readings: tuple[Reading, ...]
    fit: Fit | None

    @property
    def possible(self) -> bool:
        """Whether robot and images agree as well as a robot and a camera can."""
        most = MAX_POSSIBLE_NOISE
        return self.fit is not None and (
            self.fit.robot_translation_mm <= most.translation_mm and self.fit.robot_rotation_rad <= most.rotation_rad
        )

    @property
    def doubtful(self) -> bool:
        """Whether they agree worse than nearly every robot and camera: one pose in many may be wrong."""
        most = MAX_POSSIBLE_NOISE
        return self.fit is not None and (
            self.fit.robot_translation_mm > DOUBTFUL_SHARE * most.translation_mm
            or self.fit.robot_rotation_rad > DOUBTFUL_SHARE * most.rotation_rad
        )


@dataclass(frozen=True)
class Decision:
    """`reading`: the one to use, None where the data do not decide; `words` says why; `choices`: what is left.

    fix : what to do where no reading fits; "" for the usual. axis: the track or turntable beside the arm with which
        alone the poses fit; `solve` finds it more exactly.
    """

    reading: Reading | None
    words: str
    choices: tuple[Reading, ...] = ()
    fix: str = ""
    axis: ExternalAxis | None = None


def readings_of(
    table: PoseTable,
    setups: Sequence[Setup],
    conventions: Sequence[Convention] | None = None,
    unit: LengthUnit | None = None,
    frame: Frame | None = None,
) -> list[Reading]:
    """The readings that a table leaves open; what is given is not questioned."""
    return [
        Reading(*one)
        for one in product(
            setups,
            table.conventions() if conventions is None else conventions,
            table.units() if unit is None else (unit,),
            table.frames() if frame is None else (frame,),
        )
    ]


def compare(table: PoseTable, readings: Sequence[Reading], evidence: Evidence | None) -> list[Compared]:
    """The readings, those with the same equations together, the likeliest first."""
    groups: list[tuple[Array, list[Reading]]] = []
    for reading in readings:
        try:
            poses = table.poses(reading.convention, reading.unit, reading.frame)
        except GeometryError:
            continue
        moved = anchor_T_mount_of(reading.setup, poses)
        reach = max(float(np.abs(moved[:, :3, 3]).max()), 1.0)
        same = (one for motions, one in groups if np.abs(motions - moved).max() < SAME_POSE * reach)
        if (group := next(same, None)) is not None:
            group.append(reading)
        else:
            groups.append((moved, [reading]))
    if evidence is None or len(evidence) < MIN_VIEWS:
        return [Compared(tuple(group), None) for _, group in groups]
    few = evidence.take(evenly_spaced(len(evidence), MAX_COMPARED_VIEWS))
    fitted = _fits_of(replace(few, setup="eye-in-hand", base_T_flange=moved[few.indices]) for moved, _ in groups)
    compared = [Compared(tuple(group), fit) for (_, group), fit in zip(groups, fitted, strict=True)]
    return sorted(compared, key=lambda one: -(one.fit.log_likelihood if one.fit else 0.0))


def decide(table: PoseTable, compared: Sequence[Compared], evidence: Evidence | None) -> Decision:
    """The reading that fits, or why none can be chosen."""
    if not compared:
        return Decision(None, "no convention makes these numbers rotations")
    best, others = compared[0], compared[1:]
    if best.fit is None or evidence is None:
        if len(compared) == 1 and len(_named_apart(best.readings)) == 1:
            return Decision(best.readings[0], "")
        seen = 0 if evidence is None else len(evidence)
        left = tuple(one.readings[0] for one in compared)
        return Decision(None, f"{len(compared)} readings, and {seen} pictures to compare by (of {MIN_VIEWS})", left)
    if others and not _observable(table, best.readings[0]):
        return Decision(None, "the motions do not decide between readings", tuple(one.readings[0] for one in compared))
    agreement = f"robot and images agree to {_noise(best.fit)}"
    found = Decision(None, "")
    if not best.possible or (best.doubtful and table.varying_axes()):
        found = _explain_misfit(table, compared, evidence)
    if found.axis is not None:
        return found
    for most_rad in (MAX_TURN_RAD, MAX_POSSIBLE_NOISE.rotation_rad):  # as of good pairs, then as of the worst arm's
        if not best.possible and not found.words:
            found = _explain_pairs(table, compared, evidence, most_rad)
    if not best.possible and others:
        words = f"none fits: {best.readings[0].words} is the nearest, and {agreement}"
        size = "" if found.words else _other_size(table, compared, evidence)
        fix = found.fix or (size and "give the target's right size by --target")
        return Decision(None, words + found.words + size, (best.readings[0],), fix)
    if others:
        assert others[0].fit is not None
        n = min(len(evidence), MAX_COMPARED_VIEWS)
        gain = best.fit.log_likelihood - others[0].fit.log_likelihood
        times = float(np.exp(min(gain / (6 * n), 700.0)))
        if few_views_factor(n, 0) * gain < MIN_LOG_LIKELIHOOD_GAIN:
            words = f"{best.readings[0].words} and {others[0].readings[0].words} fit alike"
            return Decision(None, words, (best.readings[0], others[0].readings[0]))
        agreement += f"; next best {others[0].readings[0].words}: {times:.3g} times worse"
        if best.fit.robot_translation_mm > MIN_RESIZED_MM:
            agreement += _other_size(table, compared[:1], evidence)
    if len(named := _named_apart(best.readings)) > 1:
        alike = " and ".join(f"{one.setup} with {one.frame}" for one in named)
        words = f"fits: {best.readings[0].convention.name}: {agreement}; but {alike} are the same equations"
        return Decision(None, words, named)
    if not best.possible:
        words = f"{best.readings[0].words} was stated and does not fit: {agreement} only"
        more = found.words or f"{_other_size(table, compared, evidence)}; compare target and pairs"
        return Decision(best.readings[0], f"{words}{more}{found.fix and '; ' + found.fix}")
    doubt = "; robots err by less: look for a wrong pose" if best.doubtful else ""
    return Decision(best.readings[0], f"fits: {best.readings[0].words}: {agreement}{doubt}")


def _explain_misfit(table: PoseTable, compared: Sequence[Compared], evidence: Evidence) -> Decision:
    """What makes poses fit: an axis beside the arm; or, where the rotations agree, a unit, other axes, a size.

    Rotations that agree show that target and pairs are right. `words` is "" where they do not agree.
    """
    few = evidence.take(evenly_spaced(len(evidence), MAX_COMPARED_VIEWS))
    readings = [reading for group in compared for reading in group.readings[:1]]
    tried: list[_Way] = []
    possible = compared[0].possible  # then only an axis is looked for
    still, near = _agreeing_turns(few, ((_Change(table), one) for one in readings))
    if table.kind != "joints":  # an arm's joints leave no choice of lengths
        changes = [*_changes_of_lengths(table, of_pictures=evidence.pictures is not None)]
        tried = [(one, way) for _, way in near for one in changes if one.axis or not possible]
    turntables = (  # about an axis of the base; they carry no target that the flange holds
        (one, way)
        for way in readings
        if way.setup == "eye-in-hand"
        for one in _beside_the_arm(table, "turntable", "a turntable about")
    )
    turned, tables = _agreeing_turns(few, turntables)
    if turned < still:
        tried += [(_through_axis(few, *one), one[1]) for one in tables]
    if not tried:
        return Decision(None, "")
    fitted = _fits_of(_placed(few, change, one) for change, one in tried)
    best = max(range(len(tried)), key=lambda at: fitted[at].log_likelihood)
    (change, reading), fit = tried[best], fitted[best]
    shrunk = max(1.0, table.reach_mm("mm") / max(change.table.reach_mm("mm"), 1e-9))
    fit = replace(fit, variances=fit.variances * [1.0, shrunk**2])  # in the robot's own millimetres
    explained = Compared((reading,), fit)
    is_enough = not explained.doubtful if possible else explained.possible
    if is_enough and change.axis is not None:
        words = f"robot and images agree with {change.words} to {_noise(fit)} ({reading.words})"
        return Decision(reading, words, axis=change.axis)
    if possible or still > MAX_TURN_RAD:
        return Decision(None, "")
    words = f"; the rotations agree to {np.degrees(still):.2g} deg, so that target and pairs are right"
    if is_enough:
        words += f", and with {change.words} the translations agree as well: {_noise(fit)} ({reading.words})"
        return Decision(None, words, (), change.fix)
    if size := _other_size(table, compared, evidence):
        return Decision(None, words + size, (), "compare the target's size, and the units of both sides")
    fix = "compare the unit and the axes of the places with the robot's display; or describe a track (external_axis)"
    return Decision(None, words + ", and only the translations contradict", (), fix)


def _explain_pairs(table: PoseTable, compared: Sequence[Compared], evidence: Evidence, most_rad: float) -> Decision:
    """Which pairs are wrong, or by how many rows all are; `words` is "" where no rows make the rotations agree."""
    few = evidence.take(np.arange(len(evidence)) < MAX_COMPARED_VIEWS)
    seen = angles_between_images(few.camera_T_target)
    found: list[tuple[int, int, list[str]]] = []
    for reading, moved in product((one.readings[0] for one in compared), range(-MAX_MOVED, MAX_MOVED + 1)):
        rows = few.indices + moved
        inside = (rows >= 0) & (rows < len(table))
        turns = table.poses(reading.convention, reading.unit, reading.frame)[rows[inside], :3, :3]
        apart = np.abs(angles_between(turns) - seen[np.ix_(inside, inside)])
        right = np.median(apart, axis=1) <= most_rad
        enough = np.sum(right) >= max(MIN_VIEWS, MIN_RIGHT_SHARE * len(right))
        if enough and np.mean(apart[np.ix_(right, right)]) <= most_rad and (moved or not np.all(right)):
            found.append((abs(moved), moved, [table.labels[row] for row in rows[inside][~right]]))
    if not found:
        return Decision(None, "")
    rows_off, moved, labels = min(found, key=lambda one: (one[0], len(one[2])))
    if moved:
        words = f"{rows_off} row{'s' * (rows_off > 1)} {'before' if moved < 0 else 'after'} for each picture"
        fix = "correct the pairs: one end has too many or too few"
        return Decision(None, f"; with the pose {words} the rotations agree", (), fix)
    fix = "correct what is named, or leave it out with its picture; with --setup and --frame all are imported"
    return Decision(None, f"; without pose {', '.join(labels)} the rotations agree", (), fix)


@dataclass(frozen=True, eq=False)
class _Change:
    """A table with other lengths or an axis beside the arm, what was changed, and how the user does it."""

    table: PoseTable
    words: str = ""
    fix: str = ""
    axis: ExternalAxis | None = None


_Way = tuple[_Change, Reading]


def _agreeing_turns(few: Evidence, ways: Iterable[_Way]) -> tuple[float, list[_Way]]:
    """The least mismatch (rad) of the angles between the views, and the ways with about as little that agree."""
    seen = angles_between_images(few.camera_T_target)
    turned = ((_placed(few, *one).base_T_flange[:, :3, :3], one) for one in ways)
    found = [(mean_mismatch_rad(angles_between(rotations), seen), one) for rotations, one in turned]
    least = min((mismatch for mismatch, _ in found), default=np.inf)
    most = min(MAX_TURN_RAD, 2 * least + MORE_TURN_RAD)
    return least, [one for mismatch, one in found if mismatch <= most][:MAX_TURNED]


def _changes_of_lengths(table: PoseTable, *, of_pictures: bool) -> Iterator[_Change]:
    """Other units, reversed and exchanged axes, and a track along an axis of the base whose readings the table has."""
    for unit, factor in MM.items():
        if factor != 1.0 and factor * table.reach_mm("mm") >= MIN_ARM_MM:
            fix = f"multiply the places by {factor:g}, or name their unit"
            fix = f"give --unit {unit}" if unit in LENGTH_UNITS and table.unit is None else fix
            yield _Change(replace(table, lengths=factor * table.lengths), f"places in {unit}", fix)
        if factor > 1.0 and (unit == "m" or not of_pictures):  # of pictures other sizes of the target are tried
            words = f"the camera's places, or the target, {factor:g} times as large"
            fix = f"multiply the camera's places by {factor:g}, for they are in {unit}"
            fix = "give --camera-unit m" if unit == "m" else fix
            yield _Change(replace(table, lengths=table.lengths / factor), words, fix)
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            if order == (0, 1, 2) and abs(sum(signs)) == 3:  # all reversed: a mirror of the other side, too
                continue
            axes = ",".join(("-" if sign < 0 else "") + "xyz"[axis] for axis, sign in zip(order, signs, strict=True))
            named = " and ".join("xyz"[at] for at in range(3) if signs[at] < 0)
            words = f"{named} reversed" if order == (0, 1, 2) else f"the axes of the places as {axes}"
            lengths = table.lengths[:, list(order)] * signs
            yield _Change(replace(table, lengths=lengths), words, f"give --axes={axes}, or correct the poses")
    yield from _beside_the_arm(table, "track", "a track along")


def _beside_the_arm(table: PoseTable, kind: AxisKind, what: str) -> Iterator[_Change]:
    """The table with one of its moving external axes along each axis of the base, both ways."""
    unit = "mm" if kind == "track" else "degrees"
    for (number, values), at, sign in product(table.varying_axes(), range(3), (1.0, -1.0)):
        axis = ExternalAxis(kind, number, sign * np.eye(3)[at], np.zeros(3))
        words = (
            f"{what} {'-' if sign < 0 else ''}{'xyz'[at]} of the base (external axis {number}, {values.min():g} to"
            f" {values.max():g} {unit}), which the controller leaves out of its poses,"
        )
        yield _Change(table, words, axis=axis)


def _through_axis(few: Evidence, change: _Change, reading: Reading) -> _Change:
    """The change with the point of the turntable's axis that explains the places best, in the plane through the base.

    They are linear in it and in the places of X and the target, once the rotation of X is known.
    """
    assert change.axis is not None
    moved = _placed(few, change, reading).base_T_flange
    reported = _placed(few, _Change(change.table), reading).base_T_flange
    turned = moved[:, :3, :3] @ np.swapaxes(reported[:, :3, :3], 1, 2)
    rows = np.concatenate([moved[:, :3, :3], np.eye(3) - turned, np.broadcast_to(-np.eye(3), turned.shape)], axis=2)
    by_camera = moved[:, :3, :3] @ park(moved, few.camera_T_target)[:3, :3] @ few.camera_T_target[:, :3, 3:]
    found = np.linalg.lstsq(rows.reshape(-1, 9), -(by_camera[:, :, 0] + moved[:, :3, 3]).ravel())[0]
    return replace(change, axis=replace(change.axis, point_mm=found[3:6]))


def _other_size(table: PoseTable, compared: Sequence[Compared], evidence: Evidence) -> str:
    """What to say of a target of another size with which robot and images agree; "" where there is none."""
    few = evidence.take(evenly_spaced(len(evidence), MAX_COMPARED_VIEWS))
    steps = int(np.log(MAX_SIZE_RATIO) / np.log(SIZE_STEP))
    sizes = SIZE_STEP ** np.arange(-steps, steps + 1.0)
    found: list[tuple[Fit, float, Reading]] = []
    for reading in (one.readings[0] for one in compared[:MAX_RESIZED_READINGS]):
        seen = _placed(few, _Change(table), reading)
        far = _fits_of(seen.scale_target(float(size)) for size in sizes)
        coarse = float(sizes[int(np.argmin([fit.robot_translation_mm for fit in far]))])
        near = coarse * FINE_SIZE_STEP ** np.arange(-25, 26.0)
        fitted = _fits_of(seen.scale_target(float(size)) for size in near)
        found += [(fit, float(size), reading) for fit, size in zip(fitted, near, strict=True)]
    fit, size, reading = max(found, key=lambda one: one[0].log_likelihood)
    assert compared[0].fit is not None
    gain = fit.log_likelihood - compared[0].fit.log_likelihood
    little = few_views_factor(len(few), 1) * gain < MIN_LOG_LIKELIHOOD_GAIN or abs(np.log(size)) < np.log(SIZE_STEP)
    if little or not Compared((reading,), fit).possible:
        return ""
    return f"; with a target {size:.3g} times as large they agree to {_noise(fit)} ({reading.words}): compare its size"


def _placed(few: Evidence, change: _Change, reading: Reading) -> Evidence:
    """The evidence with the robot's poses of a reading, as if an axis beside the arm stood at zero."""
    poses = change.table.poses(reading.convention, reading.unit, reading.frame)
    if change.axis is not None:
        values = dict(change.table.varying_axes())[change.axis.number]
        poses = change.axis.at_zero(poses, values if change.axis.kind == "track" else np.radians(values))
    return replace(few, setup="eye-in-hand", base_T_flange=anchor_T_mount_of(reading.setup, poses)[few.indices])


def _fits_of(sessions: Iterable[Evidence]) -> list[Fit]:
    """The fit of each; where wrong readings overflow, the likelihood is the lowest."""
    every, fitted = list(sessions), list[Fit]()
    with np.errstate(all="ignore"):
        for start in range(0, len(every), BATCH):
            fitted += fits(every[start : start + BATCH])
    return fitted


def _named_apart(readings: Sequence[Reading]) -> tuple[Reading, ...]:
    """One reading for each set-up and frame; conventions with the same rotations are one."""
    return tuple({(one.setup, one.frame): one for one in reversed(readings)}.values())


def _observable(table: PoseTable, reading: Reading) -> bool:
    try:
        require_observable(table.poses(reading.convention, reading.unit, reading.frame))
    except UndeterminedError:
        return False
    return True


def _noise(fit: Fit) -> str:
    return f"{fit.robot_translation_mm:.2g} mm and {np.degrees(fit.robot_rotation_rad):.2g} deg"
