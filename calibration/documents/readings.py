"""Which convention robot poses are in, by the evidence of the images: every one is tried, the fits are compared.

A reading is one way to take the numbers: convention, unit, frame, and where the camera is. Two readings that give the
same equations are not distinguished by any data: poses of the flange in the base with the camera on it are the
inverted poses with the camera beside the robot.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product

import numpy as np

from calibration.closed_forms.observability import require_observable
from calibration.closed_forms.registry import park
from calibration.diagnosis.angle_agreement import angles_between, angles_between_images, mean_mismatch_rad
from calibration.diagnosis.convention_hypotheses import likeliest_scale
from calibration.diagnosis.diagnose import MIN_LOG_LIKELIHOOD_GAIN, MIN_VIEWS, Diagnosis, diagnose, evenly_spaced
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, fits
from calibration.diagnosis.hypothesis import few_views_factor
from calibration.documents.imports.pose_table import MIN_ARM_MM, PoseTable
from calibration.errors import GeometryError, UndeterminedError
from calibration.kinematics.conventions import LENGTH_UNITS, MM, Convention, Frame, LengthUnit
from calibration.kinematics.external_axis import AxisKind, ExternalAxis
from calibration.kinematics.robot_accuracy import MAX_POSSIBLE_NOISE
from calibration.preprocessing.pose_ambiguity import resolve_pose_ambiguity
from calibration.problem import Setup, anchor_T_mount_of
from calibration.transforms import Array

MAX_COMPARED_VIEWS = 40
"""Views by which the readings are compared."""

SAME_POSE = 1e-6
"""Largest difference of the elements of poses that are the same under two readings; of lengths per mm of arm."""

SQUARES_MM = (10.0, 100.0)
"""Squares in which places may be counted; a fifth to five times as large ones are found from each."""

MIN_GAIN_OF_SIZE = 2.0
"""Gain of log-likelihood from which on a size is not that of a unit: two standard deviations."""

BATCH = 40
"""Readings fitted together."""

SIZES, MIN_SIZE_RATIO = (0.2, 1.0, 5.0), 1.05
"""Ratios of the target's true lengths to the given ones; a fifth to five times each is looked for. The least named."""

MIN_RESIZED_MM = 1.0
"""Disagreement of robot and images, mm, from which on other sizes are tried: robots err by less."""

DOUBTFUL_SHARE = 1 / 3
"""Of the largest possible noise of a robot: 5 mm, 0.5 degrees."""

MAX_TURN_RAD, MORE_TURN_RAD, MAX_TURNED = float(np.radians(0.5)), float(np.radians(0.05)), 4
"""Mean difference of the angles between views up to which rotations agree; how much more others may differ, which are
tried as well; most of them."""

MIN_RIGHT_SHARE = 0.75
"""Share of pairs that are right, where wrong ones are looked for."""

MAX_RESIZED_READINGS, MAX_DIAGNOSED = 3, 2
"""Likeliest readings with which other sizes of the target are tried, and for which `solve`'s causes are."""


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
    """Readings with the same equations, and the fit of the images to them; None without images to compare.

    turned : whether the corners of a board that looks the same turned were numbered as `solve` does it.
    """

    readings: tuple[Reading, ...]
    fit: Fit | None
    turned: bool = False

    @property
    def possible(self) -> bool:
        """Whether robot and images agree as well as a robot and a camera can."""
        return self.fit is not None and self.fit.robot_noise.is_within(MAX_POSSIBLE_NOISE)

    @property
    def doubtful(self) -> bool:
        """Whether they agree worse than nearly every robot and camera: one pose in many may be wrong."""
        return self.fit is not None and not self.fit.robot_noise.is_within(MAX_POSSIBLE_NOISE, DOUBTFUL_SHARE)


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


def compare(
    table: PoseTable, readings: Sequence[Reading], evidence: Evidence | None, points_mm: Array | None = None
) -> list[Compared]:
    """The readings, those with the same equations together, the likeliest first.

    `points_mm` (k, 3): of a board that looks the same turned; it may be so in some pictures where no reading fits.
    """
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
    each = [replace(few, setup="eye-in-hand", base_T_flange=moved[few.indices]) for moved, _ in groups]

    def by(evidences: Sequence[Evidence], turned: bool) -> list[Compared]:
        fitted = zip(groups, _fits_of(evidences), strict=True)
        return sorted(
            (Compared(tuple(group), fit, turned) for (_, group), fit in fitted),
            key=lambda one: -(one.fit.log_likelihood if one.fit else 0.0),
        )

    compared = by(each, turned=False)
    if points_mm is None or few.pictures is None or not compared or compared[0].possible:
        return compared
    poses, errors, corners = few.camera_T_target[:, None], np.zeros((len(few), 1)), few.pictures.corners(few)
    resolved = (resolve_pose_ambiguity(corners, one.base_T_flange, poses, errors, points_mm) for one in each)
    return by(
        [one.with_camera_poses(own.camera_T_target) for one, own in zip(each, resolved, strict=True)], turned=True
    )


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
        return Decision(None, f"{len(compared)} readings, and {seen} of {MIN_VIEWS} pictures needed to compare", left)
    try:
        if others:
            one = best.readings[0]
            require_observable(table.poses(one.convention, one.unit, one.frame))
    except UndeterminedError as unseen:
        words = f"the motions do not decide between readings: {unseen.what}"
        fix = f"{unseen.fix}; or state what they are by --frame and --convention"
        return Decision(None, words, tuple(one.readings[0] for one in compared), fix)
    agreement = f"robot and images agree to {agreement_of(best.fit)}"
    found = Decision(None, "")
    if not best.possible or (best.doubtful and table.varying_axes()):
        found = _explain_misfit(table, compared, evidence)
    if found.axis is not None:
        return found
    for explain in (_explain_pairs, _explain_cause, partial(_explain_pairs, most_rad=MAX_POSSIBLE_NOISE.rotation_rad)):
        if not best.possible and not found.words:
            found = explain(table, compared, evidence)
    if not best.possible and others:
        hint = found.words or _other_size(table, compared, evidence)
        words = f"none fits{hint}{hint and '; as they are'}: {best.readings[0].words} is the nearest, and {agreement}"
        fix = found.fix or (hint and "give the target's right size by --target")
        return Decision(None, words, (best.readings[0],), fix)
    if others:
        assert others[0].fit is not None
        n = min(len(evidence), MAX_COMPARED_VIEWS)
        gain = best.fit.log_likelihood - others[0].fit.log_likelihood
        times = float(np.exp(min(gain / (6 * n), 700.0)))
        if few_views_factor(n, 0) * gain < MIN_LOG_LIKELIHOOD_GAIN:
            words = f"{best.readings[0].words} and {others[0].readings[0].words} fit alike"
            return Decision(None, words, (best.readings[0], others[0].readings[0]))
        agreement += f"; next best {others[0].readings[0].words}: {times:.3g} times worse"
        if best.fit.robot_noise.translation_mm > MIN_RESIZED_MM:
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
    """What makes poses fit: an axis beside the arm; or, where the rotations agree, a unit, squares, other axes, a size.

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
        for (_, way), size_mm in product(near, () if possible or evidence.pictures else SQUARES_MM):
            factor = size_mm * likeliest_scale(_placed(few, _Change(table), way).scale_target(size_mm))
            fix = f"multiply the camera's places by {factor:.3g}: are they counted in squares of {factor:.3g} mm?"
            smaller = replace(table, lengths=table.lengths / factor)
            change = _Change(smaller, f"the camera's places {factor:.3g} times as large", fix, penalty=MIN_GAIN_OF_SIZE)
            tried.append((change, way))
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
    best = max(range(len(tried)), key=lambda at: fitted[at].log_likelihood - tried[at][0].penalty)
    (change, reading), fit = tried[best], fitted[best]
    shrunk = max(1.0, table.reach_mm("mm") / max(change.table.reach_mm("mm"), 1e-9))
    fit = replace(fit, variances=fit.variances * [1.0, shrunk**2])  # in the robot's own millimetres
    explained = Compared((reading,), fit)
    is_enough = not explained.doubtful if possible else explained.possible
    if is_enough and change.axis is not None:
        words = f"robot and images agree with {change.words} to {agreement_of(fit, reading)}"
        return Decision(reading, words, axis=change.axis)
    if possible or still > MAX_TURN_RAD:
        return Decision(None, "")
    words = f"; the rotations agree to {np.degrees(still):.2g} deg, so that target and pairs are right"
    if is_enough:
        words += f", and with {change.words} the translations agree as well: {agreement_of(fit, reading)}"
        return Decision(None, words, (), change.fix)
    if size := _other_size(table, compared, evidence):
        return Decision(None, words + size, (), "compare the target's size, and the units of both sides")
    fix = "compare the unit and the axes of the places with the robot's display; or describe a track (external_axis)"
    cause = _explain_cause(table, compared, evidence)
    return cause if cause.words else Decision(None, words + ", and only the translations contradict", (), fix)


def _explain_cause(table: PoseTable, compared: Sequence[Compared], evidence: Evidence) -> Decision:
    """What `solve` would find in the likeliest readings with which robot and images then agree; `words` as above."""
    found: list[tuple[Diagnosis, Reading]] = []
    for reading in (one.readings[0] for one in compared[:MAX_DIAGNOSED]):
        poses = table.poses(reading.convention, reading.unit, reading.frame)[evidence.indices]
        seen = replace(evidence, setup=reading.setup, base_T_flange=poses)
        points = np.zeros((1, 3)) if seen.pictures is None else seen.pictures.seen.points_mm.reshape(-1, 3)
        cause = diagnose(seen, points.mean(axis=0), len(table))
        if cause and cause.after.is_within(MAX_POSSIBLE_NOISE, DOUBTFUL_SHARE):
            found.append((cause, reading))
    if not found:
        return Decision(None, "")
    best, reading = min(found, key=lambda one: one[0].after.translation_mm)
    left = f"{best.after.translation_mm:.2g} mm and {np.degrees(best.after.rotation_rad):.2g} deg"
    words = f"; {best.cause.message}: with that they agree to {left} ({reading.words})"
    return Decision(None, words, (), str(best.cause.fix))


def _explain_pairs(
    table: PoseTable, compared: Sequence[Compared], evidence: Evidence, most_rad: float = MAX_TURN_RAD
) -> Decision:
    """Which pairs are wrong; `words` is "" where the rotations of the others do not agree."""
    few = evidence.take(np.arange(len(evidence)) < MAX_COMPARED_VIEWS)
    seen, found = angles_between_images(few.camera_T_target), list[str]()
    for reading in (one.readings[0] for one in compared):
        turns = table.poses(reading.convention, reading.unit, reading.frame)[few.indices, :3, :3]
        apart = np.abs(angles_between(turns) - seen)
        right = np.median(apart, axis=1) <= most_rad
        enough = np.sum(right) >= max(MIN_VIEWS, MIN_RIGHT_SHARE * len(right))
        if enough and np.mean(apart[np.ix_(right, right)]) <= most_rad and not np.all(right):
            labels = ", ".join(table.labels[row] for row in few.indices[~right])
            found.append(f"; without pose {labels} the rotations agree")
    fix = "correct what is named, or leave it out with its picture; with --setup and --frame all are imported"
    return Decision(None, min(found, key=len), (), fix) if found else Decision(None, "")


@dataclass(frozen=True, eq=False)
class _Change:
    """A table with other lengths or an axis beside the arm, what was changed, and how the user does it."""

    table: PoseTable
    words: str = ""
    fix: str = ""
    axis: ExternalAxis | None = None
    penalty: float = 0.0


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
            words = ("the target" if of_pictures else "the camera's places") + f" {factor:g} times as large"
            fix = f"multiply the camera's places by {factor:g}, for they are in {unit}"
            fix = "give --camera-unit m" if unit == "m" else fix
            fix = "give the sizes of --target in mm, such as 25 for 0.025" if of_pictures else fix
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
    found: list[tuple[Fit, float, Reading]] = []
    for reading in (one.readings[0] for one in compared[:MAX_RESIZED_READINGS]):
        seen = _placed(few, _Change(table), reading)
        sizes = [size * likeliest_scale(seen.scale_target(size)) for size in SIZES]
        fitted = _fits_of(seen.scale_target(size) for size in sizes)
        found += [(fit, size, reading) for fit, size in zip(fitted, sizes, strict=True)]
    fit, size, reading = max(found, key=lambda one: one[0].log_likelihood)
    assert compared[0].fit is not None
    gain = fit.log_likelihood - compared[0].fit.log_likelihood
    little = few_views_factor(len(few), 1) * gain < MIN_LOG_LIKELIHOOD_GAIN
    if little or abs(np.log(size)) < np.log(MIN_SIZE_RATIO) or not Compared((reading,), fit).possible:
        return ""
    return f"; with a target {size:.3g} times as large they agree to {agreement_of(fit, reading)}: compare its size"


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


def agreement_of(fit: Fit, reading: Reading | None = None) -> str:
    """The robot's noise of a fit in words, and the reading."""
    noise = fit.robot_noise
    words = f"{noise.translation_mm:.2g} mm and {np.degrees(noise.rotation_rad):.2g} deg"
    return words if reading is None else f"{words} ({reading.words})"
