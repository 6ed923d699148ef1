"""The daemon's settings: a TOML file and fragments, loaded once, frozen. deploy/handeyed.example.toml has every key."""

import hashlib
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from calibration.documents.external_axis import ExternalAxisDocument
from calibration.documents.knowledge import KnowledgeDocument
from calibration.documents.planning_settings import LimitsDocument, NoiseExpectedDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.requirement import PointsDocument, Tolerance, VerdictSettings
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document, validate_document
from calibration.errors import DocumentError, GeometryError
from calibration.kinematics.abb_arms import find_any_arm
from calibration.kinematics.arm_errors import AXES
from calibration.kinematics.load import Load
from calibration.kinematics.seven_axes import SevenAxisArm
from calibration.problem import ANCHORS, MOUNTS, AxisOffset, Setup
from calibration.transforms import Array
from calibration.verdict import VerdictLimits
from daemon.config.plc_settings import InterlockSettings, PlcSettings
from daemon.config.report_settings import ReportSettings
from daemon.config.robot_settings import EgmSettings, LoadSettings, OutputSettings, SettlingSettings
from daemon.config.server_settings import ServerSettings, WebhookSettings
from daemon.runtime.bounded_read import read_bounded
from drivers.errors import AddressNotUnderstood
from drivers.registry import check_camera_address, check_robot_address, check_scanner_address, check_stop_address


def _address_validator(check: Callable[[str], object]) -> AfterValidator:
    """A validator that accepts what `check`, a driver's parser of addresses, accepts."""

    def validate(address: str) -> str:
        try:
            check(address)
        except AddressNotUnderstood as error:
            raise ValueError(f"{error.what}: {error.fix}") from None
        return address

    return AfterValidator(validate)


QuarterTurn = Annotated[int, Field(ge=-32, le=32)]
Cfx = Annotated[int, Field(ge=-32, le=9999)]
"""0 to 7, and up to four digits of an arm with seven axes."""
Box = tuple[Vector, Vector]


def _validate_arm(name: str) -> str:
    try:
        return find_any_arm(name).identifier
    except GeometryError as error:
        raise ValueError(f"{error}; leave it out for any other") from None


class TaughtPose(PoseDocument):
    """base_T_flange, with ABB's confdata when the posture matters: paste both from the robtarget.

    `arm_angle_deg`: eax_a of the robtarget of an arm with seven axes; without it the arm keeps the angle that it has.
    """

    configuration: tuple[QuarterTurn, QuarterTurn, QuarterTurn, Cfx] | None = None
    arm_angle_deg: Annotated[float, Field(ge=-360, le=360)] | None = None


class RobotSettings(Document):
    """The controller, and the limits of motion. `stop_address`: a second connection to stop the arm.

    `limit_s`: a controller that does not answer for so long is disconnected; None: 2 s, over Robot Web Services 5 s.

    `base_frame`: world_T_base, for an arm that does not stand upright at the world's origin. `carried_mm`: points of
    camera, bracket and target farthest from the flange, in its frame. `external_axis`: a track or turntable that the
    controller leaves out of its poses, found by a calibration by hand. `temperature_minutes`: how long a temperature of
    the arm holds that was stated by POST /arm/temperature.
    """

    address: Annotated[str, _address_validator(check_robot_address)]
    stop_address: Annotated[str, _address_validator(check_stop_address)] | None = None
    limit_s: Annotated[float, Field(ge=0.5, le=60)] | None = None
    model: Annotated[str, AfterValidator(_validate_arm)] | None = None
    speed_mm_s: Annotated[float, Field(gt=0, le=250)] = 100.0
    box_mm: Box
    base_frame: PoseDocument | None = None
    load: LoadSettings | None = None
    carried_mm: tuple[Vector, ...] = ()
    joint_travel_deg: Annotated[float, Field(gt=0, le=720)] = 270.0
    settling: SettlingSettings = SettlingSettings()
    egm: EgmSettings | None = None
    outputs: OutputSettings | None = None
    external_axis: ExternalAxisDocument | None = None
    temperature_minutes: Annotated[float, Field(gt=0, le=1440)] = 15.0

    @model_validator(mode="after")
    def _outputs_have_a_link(self) -> "RobotSettings":
        if self.outputs is not None and self.address.startswith("rws:"):
            raise ValueError("outputs are switched over the CB link (tcp:// or a serial line), not over rws://")
        return self

    @model_validator(mode="after")
    def _box_has_room(self) -> "RobotSettings":
        low, high = self.box_mm
        if not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError("box_mm is [[xmin, ymin, zmin], [xmax, ymax, zmax]], each minimum below its maximum")
        return self

    @property
    def model_name(self) -> str | None:
        """Name of the arm, without the line that describes one of one's own."""
        return None if self.model is None else find_any_arm(self.model).name

    @property
    def axes(self) -> int:
        """Number of the arm's axes; 6 for an arm that is not known."""
        return 7 if self.model is not None and isinstance(find_any_arm(self.model), SevenAxisArm) else 6

    @property
    def world_T_base(self) -> Array | None:
        """`base_frame` as (4, 4); None where world and base are one."""
        return None if self.base_frame is None else self.base_frame.transform()

    @property
    def stands_upright(self) -> bool:
        """Whether weight acts along the base's -z, to 8 degrees, as the sag of an arm's errors supposes."""
        return self.base_frame is None or self.base_frame.transform()[2, 2] > 0.99

    @property
    def carried(self) -> Load | None:
        """`load` without its moments of inertia."""
        return None if self.load is None else self.load.load()

    @property
    def points_mm(self) -> Array:
        """The flange's origin and `carried_mm` (n, 3), in the flange's frame."""
        return np.array([(0.0, 0.0, 0.0), *self.carried_mm])

    def inside_box(self, base_T_flange: Array) -> bool:
        """True when the flange's origin and every carried point lie in `box_mm`."""
        low, high = np.array(self.box_mm)
        points = self.points_mm @ base_T_flange[:3, :3].T + base_T_flange[:3, 3]
        return bool(np.all((points >= low) & (points <= high)))


class ExposureSettings(Document):
    """Limits, each least and greatest, within which exposure and gain are chosen for the target, picture by picture."""

    exposure_us: tuple[Annotated[float, Field(ge=1, le=1e7)], Annotated[float, Field(ge=1, le=1e7)]] = (20.0, 100_000.0)
    gain_db: tuple[Annotated[float, Field(ge=0, le=60)], Annotated[float, Field(ge=0, le=60)]] = (0.0, 6.0)

    @model_validator(mode="after")
    def _ordered(self) -> "ExposureSettings":
        if self.exposure_us[0] > self.exposure_us[1] or self.gain_db[0] > self.gain_db[1]:
            raise ValueError("exposure_us and gain_db are [least, greatest]")
        return self


class CameraSettings(Document):
    """The camera. Without intrinsics the calibration estimates them; without `exposure` it stays.

    `setup`: eye-in-hand for a camera on the flange, eye-to-hand for one beside the robot with the target on the flange.
    `limit_s`: a camera that sends no fresh picture for so long has failed.
    """

    setup: Setup = "eye-in-hand"
    address: Annotated[str, _address_validator(check_camera_address)]
    limit_s: Annotated[float, Field(gt=0, le=600)] = 5.0
    intrinsics: CameraDocument | None = None
    exposure: ExposureSettings | None = None


class ScannerSettings(Document):
    """The scanner on the flange, and the poses from which a part is scanned.

    `camera_T_scanner` None: the clouds are in the frame of the calibrated camera, as with most scanners.
    `clock_offset_s` of a line profiler: the robot's clock minus the sensor's, beyond what the daemon finds by itself.
    `range_mm`: nearest and farthest at which it measures, as its data sheet states.
    """

    address: Annotated[str, _address_validator(check_scanner_address)]
    unit: Literal["mm", "m"] = "mm"
    limit_s: Annotated[float, Field(gt=0, le=600)] = 60.0
    camera_T_scanner: PoseDocument | None = None
    poses: tuple[TaughtPose, ...] = ()
    clock_offset_s: Annotated[float, Field(ge=-1, le=1)] = 0.0
    range_mm: tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]] | None = None


DeviceName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,31}$")]

MAIN_CAMERA, MAIN_SCANNER = "camera", "scanner"
"""What [camera] and [scanner] are called where others stand beside them by name."""


class NamedScannerSettings(ScannerSettings):
    """A further scanner. `camera`: whose frame `camera_T_scanner` starts from, and whose calibration places it."""

    camera: DeviceName = MAIN_CAMERA


class CalibrationSettings(Document):
    """The poses of a calibration, its stopping rule, and whether the operator or the daemon applies the result.

    `count`: how many planned pictures; without it a run goes on until U meets the tolerance, for 12 at most.
    `tolerance_mm`: largest U (k = 2) at the worst of the points that matter. Policy "auto" needs it, and leaves to a
    person what is worse than the active calibration, or contradicts it. `known`: of target, camera and arm.
    `requests_may_loosen`: whether a request may state a larger one than is active without it. The guesses are
    flange_T_camera and base_T_target of an eye-in-hand cell, base_T_camera and flange_T_target of an eye-to-hand one.
    `axis_offset`: for an arm that turns its flange about one axis only; its poses are taught, or jogged to.
    `arm`: whether a run identifies the arm's errors, too, where its request does not say.
    """

    count: Annotated[int, Field(ge=3, le=100)] | None = None
    known: KnowledgeDocument = KnowledgeDocument()
    tolerance_mm: Tolerance | None = None
    requests_may_loosen: bool = True
    uncertainty_mm: Annotated[float, Field(gt=0)] | None = None
    policy: Literal["operator", "auto"] = "operator"
    poses: tuple[TaughtPose, ...] = ()
    flange_T_camera_guess: PoseDocument | None = None
    base_T_target_guess: PoseDocument | None = None
    base_T_camera_guess: PoseDocument | None = None
    flange_T_target_guess: PoseDocument | None = None
    guess_mm: Annotated[float, Field(gt=0, le=1000)] = 25.0
    guess_deg: Annotated[float, Field(gt=0, le=45)] = 5.0
    axis_offset: AxisOffset | None = None
    arm: bool = False
    manual_wait_s: Annotated[float, Field(gt=0, le=86_400)] = 900.0
    limits: LimitsDocument = LimitsDocument()
    noise: NoiseExpectedDocument = NoiseExpectedDocument()
    verdict: VerdictSettings = VerdictSettings()

    def mount_T_camera_guess(self, setup: Setup) -> PoseDocument | None:
        """The guess of X in this set-up."""
        return self.flange_T_camera_guess if setup == "eye-in-hand" else self.base_T_camera_guess

    def anchor_T_target_guess(self, setup: Setup) -> PoseDocument | None:
        """The guess of the target's pose in this set-up."""
        return self.base_T_target_guess if setup == "eye-in-hand" else self.flange_T_target_guess

    def verdict_limits(self, tolerance_mm: float | None = None) -> VerdictLimits:
        """The limits in force of a request with this tolerance."""
        return self.verdict.limits(tolerance_mm or self.tolerance_mm)

    def forbids(self, tolerance_mm: float | None) -> bool:
        """Whether a request must not state this tolerance."""
        loosened = tolerance_mm is not None and tolerance_mm > self.verdict_limits().tolerance_mm
        return loosened and not self.requests_may_loosen


class NamedCameraSettings(CameraSettings):
    """A further camera. What `calibration` leaves out is as in [calibration], but for poses and guesses, which are of
    one camera only; without `target` it looks at [target]."""

    target: TargetDocument | None = None
    calibration: CalibrationSettings = CalibrationSettings()


OF_ONE_CAMERA = (
    "flange_T_camera_guess", "base_T_target_guess", "base_T_camera_guess", "flange_T_target_guess", "axis_offset"
)  # fmt: skip
"""Of [calibration], what no further camera takes over, besides the poses."""


def _validate_folder(folder: str) -> str:
    if folder.startswith("~"):
        raise ValueError("a service has no home, so ~ is not replaced: give the whole path")
    return folder


class StorageSettings(Document):
    """The store's folder, relative to the settings file's folder, and how much of it is kept."""

    folder: Annotated[str, Field(min_length=1), AfterValidator(_validate_folder)] = "/var/lib/handeyed"
    reserve_mb: Annotated[float, Field(ge=0, le=1_000_000)] = 500.0
    keep_runs: Annotated[int, Field(ge=1, le=1_000_000)] = 500
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 365.0


class DriftSettings(Document):
    """How often the daemon verifies by itself (which moves the arm), and when a drift raises an alarm.

    `every_h` 0: only the MES, the PLC or an operator start verifications. `allowed_mm`: drift that raises no alarm.
    """

    every_h: Annotated[float, Field(ge=0, le=10_000)] = 0.0
    allowed_mm: Annotated[float, Field(ge=0, le=100)] = 0.0
    weight: Annotated[float, Field(gt=0, le=1)] = 0.2
    learn: Annotated[int, Field(ge=1, le=50)] = 5
    runs_between_false_alarms: Annotated[float, Field(ge=10, le=1e6)] = 1000.0


class Settings(Document):
    """The whole settings file."""

    robot: RobotSettings
    camera: CameraSettings
    scanner: ScannerSettings | None = None
    cameras: dict[DeviceName, NamedCameraSettings] = Field(default_factory=dict)
    scanners: dict[DeviceName, NamedScannerSettings] = Field(default_factory=dict)
    target: TargetDocument
    calibration: CalibrationSettings = CalibrationSettings()
    part: PointsDocument = PointsDocument()
    server: ServerSettings = ServerSettings()
    webhooks: tuple[WebhookSettings, ...] = ()
    storage: StorageSettings = StorageSettings()
    plc: PlcSettings | None = None
    interlocks: InterlockSettings | None = None
    drift: DriftSettings = DriftSettings()
    report: ReportSettings = ReportSettings()

    @model_validator(mode="before")
    @classmethod
    def _read_pitch_uncertainty(cls, data: Any) -> Any:
        """The target's certificate where it was stated until version 0.1: of its pitch, in [report]."""
        report, target = (data.get(name) if isinstance(data, dict) else None for name in ("report", "target"))
        pitch_mm = target.get("pitch_mm", target.get("square_mm")) if isinstance(target, dict) else None
        if not isinstance(report, dict) or "pitch_uncertainty_mm" not in report or pitch_mm is None:
            return data
        stated = {"source": "certified", "length_mm": pitch_mm, "uncertainty_mm": report["pitch_uncertainty_mm"]}
        calibration = {**data.get("calibration", {})}
        calibration["known"] = {"target": stated, **calibration.get("known", {})}
        without = {name: value for name, value in report.items() if name != "pitch_uncertainty_mm"}
        return {**data, "report": without, "calibration": calibration}

    @model_validator(mode="after")
    def _check_names(self) -> "Settings":
        """Refuse a name that means two devices, and a scanner beside a camera that is not there."""
        names = ("robot", MAIN_CAMERA, MAIN_SCANNER, *self.cameras, *self.scanners)
        if repeated := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"two devices are called {repeated[0]!r}: call one of them otherwise")
        for name, scanner in self.scanners.items():
            if scanner.camera not in self.camera_names:
                raise ValueError(f"[scanners.{name}] camera {scanner.camera!r} is none of {self.camera_names}")
        return self

    @model_validator(mode="after")
    def _check_setups(self) -> "Settings":
        """Refuse what belongs to the other set-up."""
        for name in self.cameras:
            self.of_camera(name)._check_setup()
        return self._check_setup()

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Of all cameras, the one of [camera] first."""
        return (MAIN_CAMERA, *self.cameras)

    @property
    def listens_at(self) -> dict[str, str]:
        """Addresses at which the daemon listens, by the section that names them."""
        hosts = {"server": self.server.host}
        if self.plc is not None:
            hosts["plc"] = self.plc.host
        if self.robot.egm is not None:
            hosts["robot.egm"] = self.robot.egm.host
        return hosts

    def named_scanners(self) -> dict[str, NamedScannerSettings]:
        """All scanners by name, the one of [scanner] first."""
        main = {} if self.scanner is None else {MAIN_SCANNER: NamedScannerSettings(**dict(self.scanner))}
        return {**main, **self.scanners}

    @property
    def reach_mm(self) -> float | None:
        """The arm's reach; None where it is not known, or a camera stands beside the arm."""
        beside = any(camera.setup == "eye-to-hand" for camera in (self.camera, *self.cameras.values()))
        return None if beside or self.robot.model is None else find_any_arm(self.robot.model).reach_mm

    def placed_by_rig(self, scanner: str) -> bool:
        """Whether the active rig gives this scanner's place: a further one without `camera_T_scanner`."""
        return scanner in self.scanners and self.scanners[scanner].camera_T_scanner is None

    def camera_beside(self, scanner: str) -> str:
        """Name of the camera whose calibration places the clouds of this scanner."""
        return self.scanners[scanner].camera if scanner in self.scanners else MAIN_CAMERA

    def scanner_beside(self, camera: str) -> str:
        """Name of the first scanner that this camera places; [scanner] where there is none."""
        beside = (name for name, scanner in self.named_scanners().items() if scanner.camera == camera)
        return next(beside, MAIN_SCANNER)

    def of_camera(self, name: str) -> "Settings":
        """The settings with this camera in [camera], and its target and calibration in place of the shared ones."""
        if name == MAIN_CAMERA:
            return self
        camera = self.cameras[name]
        own = {field: getattr(camera.calibration, field) for field in camera.calibration.model_fields_set}
        calibration = self.calibration.model_copy(update={**dict.fromkeys(OF_ONE_CAMERA), "poses": (), **own})
        scanner = self.scanners.get(self.scanner_beside(name))
        update: dict[str, Any] = {"camera": camera, "target": camera.target or self.target, "calibration": calibration,
                  "scanner": scanner, "cameras": {}, "scanners": {}}  # fmt: skip
        return self.model_copy(update=update)

    def _check_setup(self) -> "Settings":
        setup = self.camera.setup
        other: Setup = "eye-to-hand" if setup == "eye-in-hand" else "eye-in-hand"
        for name in (f"{MOUNTS[other]}_T_camera_guess", f"{ANCHORS[other]}_T_target_guess"):
            if getattr(self.calibration, name) is not None:
                raise ValueError(f"[calibration] {name} belongs to {other}, but [camera] setup is {setup}")
        if self.calibration.policy == "auto" and self.calibration.tolerance_mm is None:
            raise ValueError(
                '[calibration] policy = "auto" needs tolerance_mm: state the largest U (k = 2) that the part allows, or'
                ' let an operator apply results (policy = "operator")'
            )
        if self.calibration.arm and not (self.robot.model and self.robot.axes == AXES and self.robot.stands_upright):
            raise ValueError("[calibration] arm needs a model of six axes, base_frame upright: else leave arm out")
        axis = self.robot.external_axis
        if setup == "eye-to-hand" and axis is not None and axis.kind == "turntable":
            raise ValueError("[robot.external_axis] a turntable carries the target, but it is on the flange here")
        if setup == "eye-to-hand" and self.scanner is not None and self.scanner.poses:
            raise ValueError("[scanner] poses are for a scanner on the flange, but [camera] setup is eye-to-hand")
        return self


OF_SERVICES = ("webhooks", "plc")
"""Sections of which each has a service of its own, perhaps an extension's, that takes a changed one over."""

FRAGMENTS = "conf.d"
"""Folder beside the settings file: its *.toml in the order of their names, each over what was read before."""


@dataclass(frozen=True)
class SettingsFile:
    """Which file was loaded, and the SHA-256, in hexadecimal, of what it and its fragments held then.

    `given_by`: the file of each value in force, as "robot.speed_mm_s".
    """

    file: str
    sha256: str
    given_by: Mapping[str, str] = field(default_factory=dict)

    def name_files(self, error: DocumentError) -> DocumentError:
        """The error with the file of each value that it names, where fragments are read."""
        problems = list(error.problems) if len(set(self.given_by.values())) > 1 else []
        for number, problem in enumerate(problems):
            place = re.sub(r"\[\d+\].*", "", problem.place)
            places = (f"{place}.", re.sub(r"[^.]*\.([^.]*)$", r"\1.", place))  # without the kind of a target
            files = {file for name, file in self.given_by.items() if f"{name}.".startswith(places)}
            if len(files) == 1:
                problems[number] = replace(problem, what=f"{problem.what} (in {files.pop()})")
        return DocumentError(error.origin, problems) if problems else error


def load_settings(path: Path) -> Settings:
    """Load the settings from a TOML file and its fragments. Raises DocumentError with file, place, what and fix."""
    return load_settings_file(path)[0]


def load_settings_file(path: Path) -> tuple[Settings, SettingsFile]:
    """As `load_settings`, and what was loaded. Raises DocumentError."""
    data, loaded = read_settings(path)
    try:
        settings = validate_document(Settings, data, str(path))
    except DocumentError as error:
        raise loaded.name_files(error) from None
    beside = path.resolve().parent
    update = {
        "storage": settings.storage.model_copy(update={"folder": str(beside / settings.storage.folder)}),
        "server": settings.server.beside(beside),
        "webhooks": tuple(webhook.beside(beside) for webhook in settings.webhooks),
    }
    return settings.model_copy(update=update), loaded


def read_settings(path: Path) -> tuple[dict[str, Any], SettingsFile]:
    """What the file and its fragments hold, not yet validated, and which file gives what. Raises DocumentError."""
    data: dict[str, Any] = {}
    given_by: dict[str, str] = {}
    whole, folder = hashlib.sha256(), path.parent / FRAGMENTS
    try:
        folder = path.resolve().parent / FRAGMENTS
        found = sorted(file for file in folder.iterdir() if re.fullmatch(r"[^.].*\.toml", file.name))
    except (FileNotFoundError, NotADirectoryError, RuntimeError):  # a link to itself is refused below
        found = []
    except OSError as error:
        raise DocumentError.one(
            str(folder), "folder", error.strerror or str(error), "let the daemon's user read it"
        ) from None
    for file in (path, *found):
        try:
            content = read_bounded(file)
        except OSError as error:
            what = error.strerror or str(error)
            raise DocumentError.one(str(file), "document", what, "give its path; 'handeyed init' writes one") from None
        whole.update(content if file == path else f"\n{file.name}\n".encode() + content)
        merge_tables(data, parse_toml(content, str(file)), given_by, str(file))
    return data, SettingsFile(str(path.resolve()), whole.hexdigest(), given_by)


def merge_tables(data: dict[str, Any], more: dict[str, Any], given_by: dict[str, str], file: str) -> None:
    """Put `more` over `data` key by key, and note in `given_by` that `file` gives its values.

    A list is replaced as a whole, and so is a table of another `kind`, such as a target.
    """
    pending = [(data, more, "")]
    while pending:
        into, table, above = pending.pop(0)
        for key, value in table.items():
            name, old = f"{above}{key}", into.get(key)
            kept = isinstance(value, dict) and isinstance(old, dict) and value.get("kind") in (None, old.get("kind"))
            if key in into and not kept:
                for replaced in [each for each in given_by if f"{each}.".startswith(f"{name}.")]:
                    del given_by[replaced]
            if isinstance(value, dict):
                into[key] = old if kept else {}
                pending.append((into[key], value, f"{name}."))
            else:
                into[key], given_by[name] = value, file


def parse_settings(content: bytes, origin: str) -> Settings:
    """Parse the content of a TOML file. Raises DocumentError."""
    return validate_document(Settings, parse_toml(content, origin), origin)


def parse_toml(content: bytes, origin: str) -> dict[str, Any]:
    """Its tables, not yet validated. Raises DocumentError."""
    try:
        return tomllib.loads(content.decode("utf-8-sig"))  # the mark of Windows' editors
    except UnicodeDecodeError as error:
        raise DocumentError.one(origin, f"byte {error.start}", "not UTF-8 text", "save the file as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise DocumentError.one(origin, "document", f"not TOML ({error})", "correct the line") from None
    except (ValueError, RecursionError) as error:  # an integer of thousands of digits; brackets a thousand deep
        raise DocumentError.one(origin, "document", f"beyond what is read ({error})", "shorten it") from None
