"""Select the poses of a run: those of the request, else taught ones, else planned ones."""

from dataclasses import dataclass, replace
from math import radians

from calibration.camera import CameraModel
from calibration.diagnosis.mount_check import ExpectedMount
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.external_axis import ExternalAxisDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.target import TargetDocument
from calibration.kinematics.robot_accuracy import NoiseBelief
from calibration.planning.next_view import StoppingRule
from calibration.planning.scene_belief import ScenePrior
from calibration.planning.viewpoints import ViewpointLimits
from calibration.problem import AxisOffset, Setup
from calibration.sentences.sentence import Sentence
from calibration.solution import NamedPoint
from daemon.cell.motion_rules import MotionRules
from daemon.config.settings import CalibrationSettings, Settings, TaughtPose
from daemon.errors import NoPoses
from daemon.model.requests import CalibrateRequest
from daemon.runs.adaptive_sequence import AdaptiveParameters


@dataclass(frozen=True)
class SceneGuess:
    """Rough knowledge of the scene: the settings' guesses, else the active calibration, whose is `lens_before`."""

    setup: Setup
    camera: CameraModel | None
    mount_T_camera: PoseDocument | None
    anchor_T_target: PoseDocument | None
    lens_before: CameraModel | None = None

    @classmethod
    def from_calibration(cls, calibration: CalibrationDocument) -> "SceneGuess":
        """The scene according to a calibration, for its verification."""
        camera = calibration.camera.camera() if calibration.camera else None
        return cls(calibration.setup, camera, calibration.mount_T_camera, calibration.anchor_T_target)

    def complete(self, current: CalibrationDocument) -> "SceneGuess":
        """With what the active calibration says and no guess does; of another set-up it says nothing."""
        if current.setup != self.setup:
            return self
        return replace(
            self,
            lens_before=current.camera.camera() if current.camera else None,
            mount_T_camera=self.mount_T_camera or current.mount_T_camera,
            anchor_T_target=self.anchor_T_target or current.anchor_T_target,
        )


def require_planned_poses(axis_offset: AxisOffset | None, rules: MotionRules) -> None:
    """Raises NoPoses for an arm with seven axes, and for one that cannot tilt its flange as planned poses do."""
    if rules.seven is not None:
        raise NoPoses(Sentence("taught-not-planned", arm=rules.seven.name), Sentence("teach-with-arm-angle"))
    if axis_offset is not None:
        raise NoPoses(Sentence("planned-poses-tilt"), Sentence("teach-turned-poses"))


def complete_request(settings: Settings, request: CalibrateRequest) -> CalibrateRequest:
    """The request, with what the settings say of the arm's errors where it does not, and where they can be found.

    Raises NoPoses as `require_by_hand`.
    """
    axis = settings.robot.external_axis
    require_by_hand(axis, request)
    found = settings.calibration.arm and not request.together and axis is None
    return request if request.arm is not None else request.model_copy(update={"arm": found})


def require_by_hand(axis: ExternalAxisDocument | None, request: CalibrateRequest) -> None:
    """Raises NoPoses for a run that would drive the arm where the axis has to move, too, and would not see it."""
    if axis is None:
        return
    if not request.manual:
        fix = Sentence("calibrate-by-hand-between", body='{"manual": true}')
        raise NoPoses(Sentence("axis-needs-hand", axis=Sentence(f"axis-{axis.kind}")), fix)
    if request.together or request.arm:
        raise NoPoses(Sentence("not-with-external-axis"), Sentence("leave-together-out"))


def select_taught_poses(settings: CalibrationSettings, count: int | None) -> tuple[TaughtPose, ...]:
    """All taught poses or the first `count`; empty when none are taught. Raises NoPoses when there are fewer."""
    if count is None or not settings.poses:
        return settings.poses
    if count > len(settings.poses):
        what = Sentence("fewer-poses-taught", count=count, taught=len(settings.poses))
        raise NoPoses(what, Sentence("ask-fewer-or-teach"))
    return settings.poses[:count]


MAX_VIEWS = 12
"""Most views of a run that goes on until it is enough."""

MAX_HURRIED_MM = 0.5
"""Widest tolerance to which poses lead in the least time: by a wider one a run ends while U still falls fast."""


def stopping_rule(settings: CalibrationSettings, request: CalibrateRequest) -> StoppingRule:
    """When a run with planned views ends: at the `count` of settings or request, else when U meets the tolerance.

    A request that states a tolerance or an uncertainty beside a count ends at whichever comes first. Poses lead to a
    stated tolerance in the least time. A wide one is met by the first few, which leave the least U, as without one.
    """
    fixed = request.count or settings.count
    goal = request.tolerance_mm or settings.verdict_limits().tolerance_mm
    if fixed is None:
        stated = request.tolerance_mm is not None or settings.verdict_limits().tolerance_stated
        hurried = stated and goal <= MAX_HURRIED_MM
        return StoppingRule(MAX_VIEWS - 1, request.uncertainty_mm or settings.uncertainty_mm, goal, hurried)
    return StoppingRule(fixed, request.uncertainty_mm or settings.uncertainty_mm, request.tolerance_mm)


def planning_limits(settings: CalibrationSettings, rules: MotionRules) -> ViewpointLimits:
    limits = settings.limits.model_copy(update={"box_mm": settings.limits.box_mm or rules.robot.box_mm}).limits()
    return replace(limits, speed_mm_s=rules.robot.speed_mm_s)


def adaptive_parameters(
    settings: CalibrationSettings,
    rules: MotionRules,
    target: TargetDocument,
    known: SceneGuess,
    wish: StoppingRule,
    points: tuple[NamedPoint, ...] = (),
    belief: NoiseBelief | None = None,
) -> AdaptiveParameters:
    """Parameters of an adaptive sequence. The first look must show the target unless both guesses are given.

    `points`: where the uncertainty counts; the working volume without any. `belief`: in the robot's noise.
    """
    guess = ScenePrior(
        known.setup,
        target,
        known.camera,
        known.mount_T_camera.transform() if known.mount_T_camera else None,
        known.anchor_T_target.transform() if known.anchor_T_target else None,
        settings.noise.noise(belief),
        radians(settings.guess_deg),
        settings.guess_mm,
        points,
        settings.known.knowledge(),
        known.lens_before,
    )
    unknown = "the intrinsics are unknown: planned from a usual field of view until they are"
    assumed = "" if known.camera or known.lens_before else unknown
    return AdaptiveParameters(guess, planning_limits(settings, rules), wish, rules, assumed)


def mount_expectation(settings: CalibrationSettings, setup: Setup) -> ExpectedMount | None:
    """The expected mount of the camera, when the settings give one."""
    guess = settings.mount_T_camera_guess(setup)
    if guess is None:
        return None
    sigma = settings.verdict.mount_sigma
    return ExpectedMount(guess.transform(), sigma * settings.guess_mm, sigma * radians(settings.guess_deg))
