"""What `handeyed import` and `solve` make of 30 public repositories: `python -m benchmarks.daemon.repositories FOLDER`.

FOLDER/OWNER/NAME holds the files of each repository at its commit (`git archive`, zip files unpacked); nothing of them
is kept here. They are the first 30 by this rule: names with `handeye`, `hand_eye` and `hand-eye`, in turn from three
lists, those with most versions of files first; an arm's poses or joints with pictures, the camera's poses, points or
profiles in the snapshot; not tried before, but for the two of line scanners. Targets are those of the repository, or as
import named their size.

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
    Repository("ethz-asl/hand_eye_calibration", "966cd92", "datasets/robot_arm",
               _robot("*hinge.csv", "--camera-poses", "*target_ir.csv", *IN_HAND),
               why="two recordings of a moving arm by two rates: 2817 and 1703 poses are not paired by time"),
    Repository("soheilsarabandi/Hand-Eye-Calibration", "0fecf80", "RealDataSet", _board("8x6:24", *IN_HAND),
               (103.6, 82.1, -33.0)),
    Repository("DamianLari/handeyeTiago", "8c96651", "", _robot("handeye.csv", *TO_HAND),
               why="its motions leave conventions open, and OpenCV finds 12 degrees at best"),
    Repository("YeonUk-Kim0120/Hand_Eye_Calibration", "47d9d5e", "",
               _robot("calibration_samples_eye_in_hand.npz", *IN_HAND), (122.9, 208.5, 138.9), "stated"),
    Repository("Muligheder/Hand-eye-Calibration", "fcdee00", "Test_program/build/poses_and_images", IN_HAND,
               (88.9, 84.7, -87.8)),
    Repository("AustinZzb/calibrateHandEye", "27d3dee", "Data/Line", ("--convention", "kuka"), artefact="edge",
               why="profiles of no sphere, plane or edge, turned about one axis"),
    Repository("chrwave/Hand_Eye_Calibration", "12bbb2f", "ExamplePictures",
               ("--images", "PictureNr*", *_board("9x6:25", *IN_HAND)), (-0.1, 73.1, 64.3)),
    Repository("LPDer/hand-eye-robot-calibration", "3c403f6", "data", _robot("sim_data_POE_noise_0.mat"),
               why="joints of an arm by exponentials with points of three spheres, to identify its kinematics"),
    Repository("Phayuth/handeye_calibration_lite", "b44955f", "calib_log",
               _robot("handeye_calibration_log.json", *IN_HAND), (-33.1, -60.8, 107.6), "stated"),
    Repository("Krasnikovs/hand_eye_calibration", "febcefa", "photo/31_5", _board("8x5:20", *IN_HAND),
               why="the pictures are arrays within the .npz of the poses"),
    Repository("loovi7/hand-eye-calibration", "b04a9ee", "Project1/Project1",
               _robot("handEye.yml", "--camera-poses", "leftVectors.yml", *IN_HAND), (-32.4, -71.8, 22.1)),
    Repository("ImperialCollegeLondon/ReCoDE-HandEyeCalibration", "7f883cd", "input", (),
               why="places of a surgical tool without orientation, and balls on it in depth images"),
    Repository("GuoXiaolong2018/Hand_eye_calibration", "75544b9", "", (), why="a sheet (.xlsx)"),
    Repository("monroe-dev/hand-eye", "08f9eef", "data/kuka_2", _board("24x17:15", *IN_HAND), (14.4, -107.9, -81.9)),
    Repository("jiangjiang-888/handeye-calib-er", "e077152", f"src/{CONFIG}",
               _robot("myBuddy_hand_to_eye_record_windows_aruco.csv", *TO_HAND),
               why="the sides contradict: OpenCV leaves 77 degrees"),
    Repository("936804292/hand_eye_calibration", "d750f98", "", _robot("handEyeData.yaml"),
               why="the sides contradict: OpenCV leaves 53 degrees"),
    Repository("ienebuse/hand-eye-calibration", "ec88db0", "dataset/highR_highT", (), why="a pickle"),
    Repository("QuantuMope/handeye-4dof", "1c2481f", "example_data", (), why="a pickle"),
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
