"""What `handeyed import` and `solve` make of 30 public repositories: `python -m benchmarks.daemon.repositories FOLDER`.

FOLDER/OWNER/NAME holds the files of each repository at its commit (`git archive`, zip files unpacked); nothing of them
is kept here. They are the first 30 by this rule: names with `handeye`, `hand_eye` and `hand-eye`, in turn from three
lists, those with most versions of files first; an arm's poses or joints with pictures, the camera's poses, points or
profiles in the snapshot; not tried before, but for the two of line scanners. Three of these hold other tasks (OTHER).
The next three of the lists (NEXT) stand in their places, chosen before they were tried. Targets are those of the
repository, or as import named their size. Options are those that import asks for, as the repository's code has it.

"in": X lies within MAX_OFF_MM of what the repository states, or of what calibrateHandEye of OpenCV 4.12 finds on the
same pairs. Another convention or direction is hundreds of mm off; some sets determine X to 50 mm only.
"refused": by import or solve. "WRONG": all else.
"""

import argparse
import json
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from extensions.sweeps.cli.profiles import app as profiles
from tests.daemon.cli.running import Ran, handeyed

MAX_OFF_MM = 60.0
IN_HAND, TO_HAND = ("--setup", "eye-in-hand"), ("--setup", "eye-to-hand")
FLANGE, BASE = "flange_T_camera", "base_T_camera"


@dataclass(frozen=True)
class Repository:
    """One repository with the folder and options that its user gives.

    translation_mm : of X (`x`), by `source`; None where the set is to be refused, for the reason `why`.
    artefact : of profiles taken standing, for `handeyed profiles calibrate`.
    """

    name: str
    commit: str
    folder: str
    options: Sequence[str]
    translation_mm: tuple[float, float, float] | None = None
    source: str = "OpenCV"
    x: str = FLANGE
    why: str = ""
    artefact: str = ""


def _board(columns_rows_pitch: str, *more: str) -> tuple[str, ...]:
    return ("--target", f"chessboard:{columns_rows_pitch}", *more)


def _robot(pattern: str, *more: str) -> tuple[str, ...]:
    return ("--poses", pattern, *more)


CONFIG = "handeye-calib/config"
GLUVER = _robot("filtered_pose_data_2025-02-26_15-25-11.csv", "--images", "2025-02-26_15-25-11/*")
SUKAI = _robot("extrinsic_param_hand_in_eye.xml", "--images", "images2/*")
OF_TIAGO = ("--unit", "m", "--camera-unit", "m", "--convention", "euler-xyz-rad", "--frame", "base_T_flange")
MARKER = ("--target", "aruco-marker:50:DICT_6X6_250:5")
CHARUCO = ("--target", "charuco:9x6:40:35:DICT_4X4_250")

REPOSITORIES = (
    Repository("GilbertPan97/HandEyeSync", "70bc59e", "data/LeiChi-12.22/sphere/cam1", ("--convention", "fanuc"),
               (671.4, -676.0, 689.6), "stated", artefact="sphere:40"),
    Repository("islers/hand_eye_calibration", "fb1ebb0", "test_data",
               _robot("manually_retrieved_simulation_data.txt", *IN_HAND), (-48.0, -2.0, -50.0)),
    Repository("ArdooTala/Hand-Eye-Calibration", "cdb6300", "example/data", (*CHARUCO, *IN_HAND), (50.3, -0.5, -13.3)),
    Repository("sukai33/HandEyeCalibration", "cd6ca15", "build/bin", (*SUKAI, *_board("6x9:20", *IN_HAND)),
               (-17.5, 71.7, -4.0)),
    Repository("WangQinStu/hand_eye_calibration", "79c2ce2", "eyeInHand_calibration/data/images3",
               _board("11x8:15", *IN_HAND), (108.4, 57.9, 117.1)),
    Repository("soheilsarabandi/Hand-Eye-Calibration", "0fecf80", "RealDataSet", _board("8x6:24", *IN_HAND),
               (103.6, 82.1, -33.0)),
    Repository("DamianLari/handeyeTiago", "8c96651", "", _robot("handeye.csv", *TO_HAND, *OF_TIAGO),
               (215.8, 22.0, 1108.6), "stated", x=BASE),
    Repository("YeonUk-Kim0120/Hand_Eye_Calibration", "47d9d5e", "",
               _robot("calibration_samples_eye_in_hand.npz", *IN_HAND), (122.9, 208.5, 138.9), "stated"),
    Repository("Muligheder/Hand-eye-Calibration", "fcdee00", "Test_program/build/poses_and_images", IN_HAND,
               (88.9, 84.7, -87.8)),
    Repository("AustinZzb/calibrateHandEye", "27d3dee", "Data/Line", ("--convention", "kuka"), artefact="edge",
               why="profiles of no sphere, plane or edge, turned about one axis"),
    Repository("chrwave/Hand_Eye_Calibration", "12bbb2f", "ExamplePictures",
               ("--images", "PictureNr*", *_board("9x6:25", *IN_HAND)), (-0.1, 73.1, 64.3)),
    Repository("643111516qq-oss/hand-eye-calibration", "75a198e", "eyeinhand/eyeinhand/data",
               _board("8x5:20", *IN_HAND), (-55.0, 47.9, 46.9)),
    Repository("Phayuth/handeye_calibration_lite", "b44955f", "calib_log",
               _robot("handeye_calibration_log.json", *IN_HAND), (-33.1, -60.8, 107.6), "stated"),
    Repository("Krasnikovs/hand_eye_calibration", "febcefa", "photo/31_5", _board("8x5:20", *IN_HAND),
               why="its board lies on a larger one, and is found in one of eight pictures"),
    Repository("loovi7/hand-eye-calibration", "b04a9ee", "Project1/Project1",
               _robot("handEye.yml", "--camera-poses", "leftVectors.yml", *IN_HAND), (-32.4, -71.8, 22.1)),
    Repository("CanCanZeng/hand_eye_calib", "3bb9cd7", "data2", _board("12x11:12", *IN_HAND), (-30.8, 77.9, 117.1)),
    Repository("GuoXiaolong2018/Hand_eye_calibration", "75544b9", "", (), (374.5, -102.4, 450.1), "a rigid fit", BASE),
    Repository("monroe-dev/hand-eye", "08f9eef", "data/kuka_2", _board("24x17:15", *IN_HAND), (14.4, -107.9, -81.9)),
    Repository("jiangjiang-888/handeye-calib-er", "e077152", f"src/{CONFIG}",
               _robot("myBuddy_hand_to_eye_record_windows_aruco.csv", *TO_HAND),
               why="the sides contradict: OpenCV leaves 77 degrees"),
    Repository("936804292/hand_eye_calibration", "d750f98", "",
               _robot("handEyeData.yaml", *IN_HAND, "--frame", "base_T_flange"), (92.2, 72.3, -146.8),
               "OpenCV without pair 5"),
    Repository("ienebuse/hand-eye-calibration", "ec88db0", "dataset/highR_highT", _robot("*.pickle", *TO_HAND),
               (60.8, -1122.1, 814.7), x=BASE),
    Repository("QuantuMope/handeye-4dof", "1c2481f", "example_data", _robot("pose_samples.pkl", *IN_HAND),
               why="an arm of four axes, which leaves X open along the fourth: one number is asked for"),
    Repository("TIMIDBABY/hand_eye_calibrate", "244cb14", "collect_data_in", _board("11x8:20", *IN_HAND),
               (-43.5, 66.8, 6.7)),
    Repository("djy89/hand-eye-calibration", "6af28e7", "calibration/camera2", TO_HAND, (918.0, 397.0, 498.0), x=BASE),
    Repository("gluver/HandEyeCalib", "8cc1d79", "input_data", (*GLUVER, *_board("4x3:50", *TO_HAND)),
               (1924.2, -774.6, 2664.4), "stated", x=BASE),
    Repository("innns/hand_eye_calibration", "99f2d4d", "", TO_HAND, (1104.7, -544.6, 356.0), x=BASE),
    Repository("beifeng-j/hand-eye-ros", "e79bdb7", CONFIG, _robot("mixed_euler_test_data.txt", *IN_HAND),
               (-8.2, 76.7, 79.4)),
    Repository("tailong-wu/hand_eye_calibrate_piper", "4697c6a", "collect_data_piper", _board("10x7:15", *IN_HAND),
               (-63.6, 50.9, 34.4)),
    Repository("NirshalChandraSekar/hand-eye-calibration", "1b3e478", "",
               _robot("eef_poses/*", *MARKER, *TO_HAND), (-121.2, -90.6, -224.3), x=BASE),
    Repository("pumpkin-ws/hand-eye2", "31937a6", "bin/data/eih", _board("9x6:18", *IN_HAND), (-33.5, -98.1, -157.8)),
)  # fmt: skip

OTHER = {
    "ethz-asl/hand_eye_calibration": "two recordings of a moving arm by their own clocks, to be aligned in time first",
    "LPDer/hand-eye-robot-calibration": "joints of an arm with points of three spheres, to identify its kinematics",
    "ImperialCollegeLondon/ReCoDE-HandEyeCalibration": "places of a surgical tool, and its balls in depth images",
}
"""Of the first 30 by the rule, and why no pose of a camera can be imported from them."""

NEXT = ("WangQinStu/hand_eye_calibration", "643111516qq-oss/hand-eye-calibration", "CanCanZeng/hand_eye_calib")
"""The next of the lists with `hand_eye` and `hand-eye`, in turn; the one with `handeye` was at its end."""


def try_one(folder: Path, one: Repository, out: Path) -> tuple[str, str]:
    """ "in", "refused", "WRONG" or "absent", and what was said; `out` is a folder for what is written."""
    inside = folder / one.name / one.folder
    if not inside.is_dir():
        return "absent", str(inside)
    if one.artefact:
        given: tuple[str | Path, ...] = ("calibrate", inside, "--artefact", one.artefact, *one.options, "--json")
        return _compared(one, handeyed(*given, command_line=profiles))
    ran = handeyed("import", inside, *one.options, "--out", out)
    if ran.status != 0:
        return "refused", ran.err
    return _compared(one, handeyed("solve", out, "--json"))


def _compared(one: Repository, solved: Ran) -> tuple[str, str]:
    found = json.loads(solved.out or "{}")
    found = (found if isinstance(found, dict) else found[0]).get(one.x)
    if found is None:
        return "refused", solved.err or "no X"
    if one.translation_mm is None:
        return "WRONG", f"X at {found['translation_mm']}, which nothing confirms"
    off_mm = float(np.linalg.norm(np.subtract(found["translation_mm"], one.translation_mm)))
    verdict = "accepted" if solved.status == 0 else "not accepted"
    return "in" if off_mm <= MAX_OFF_MM else "WRONG", f"{verdict}, {off_mm:.1f} mm from X as {one.source} has it"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="with OWNER/NAME below it")
    parser.add_argument("--only", default="", help="repositories whose names contain this")
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    for one in REPOSITORIES:
        if options.only not in one.name:
            continue
        with tempfile.TemporaryDirectory() as out:
            outcome, said = try_one(options.folder, one, Path(out) / "session")
        counts[outcome] += 1
        expected = "refused" if one.translation_mm is None else "in"
        other = "" if outcome == expected else f" (expected: {expected})"
        print(f"{outcome:8} {one.name}@{one.commit}{other}: {one.why or ' '.join(said.split())[:160]}", flush=True)
    print(dict(counts))


if __name__ == "__main__":
    main()
