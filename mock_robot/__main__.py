"""`handeyed mock run | truth | score | faults`, also python -m mock_robot."""

import argparse
import asyncio
import json
import socket
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mock_robot.errors import MockError

if TYPE_CHECKING:
    from mock_robot.truth.truth import CellTruth

ARM_CLASSES = ("perfect", "calibrated", "standard", "worn")
"""As mock_robot.arm.built_arm, which is imported only when it is used."""
PORTS = {
    "robot": "the robot program's link",
    "devices": "cameras and scanners, HTTP",
    "control": "what people do at the cell, HTTP",
    "rws": "Robot Web Services 1.0, HTTP",
    "rws2": "Robot Web Services 2.0, HTTPS",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        return int(options.command(options))
    except (OSError, MockError) as error:
        sys.stderr.write(f"handeyed mock: {error}\n")
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="handeyed mock", description="A simulated ABB cell with known truth.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="start the cell; print one JSON line with every address when it is ready")
    _add_setup(run)
    run.add_argument("--time-scale", type=_positive, default=1.0, help="how many times faster than real the arm moves")
    run.add_argument("--host", type=_own_address, default="127.0.0.1", help="an address of this machine")
    for name, what in PORTS.items():
        run.add_argument(f"--{name}-port", type=_port, default=0, help=f"{what}; 0: chosen by the system")
    run.add_argument(
        "--controller",
        choices=("rapid", "python"),
        help="robot program: the shipped RAPID, interpreted (the default where its files are), "
        "or a fast equivalent in Python",
    )
    run.add_argument("--egm", type=_address, metavar="HOST:PORT", help="send EGM there, 250 packets a second")
    run.add_argument(
        "--profiler-port", type=_port, help="a line profiler in the scanner's place; 0: chosen by the system"
    )
    run.add_argument("--robot-only", action="store_true", help="without camera and scanner")
    run.add_argument(
        "--serial", action="store_true", help="open a serial line (a pty): with RAPID in place of the socket"
    )
    run.add_argument("--home", type=_folder, help="run the RAPID of this folder: a controller's HOME, or a backup")
    run.add_argument("--bare", action="store_true", help="a controller without the robot program, to set up over RWS")
    run.add_argument("--virtual", action="store_true", help="RWS says that it is RobotStudio's controller")
    run.add_argument("--without", action="append", default=[], metavar="OPTION", help="an absent option, as 623-1")
    run.add_argument("--deny", action="append", default=[], metavar="GRANT", help="an absent grant, as UAS_CFG_WRITE")
    run.add_argument("--fault", action="append", default=[], metavar="NAME", help="begin with this fault; repeatable")
    run.add_argument("--ready-file", type=Path, help="write the JSON line there")
    run.add_argument("--with-parent", action="store_true", help="end when standard input closes")
    run.set_defaults(command=_run)

    load = commands.add_parser("load", help="load each module below a folder; name what the interpreter does not know")
    load.add_argument("folder", type=_folder)
    load.add_argument("--json", action="store_true")
    load.set_defaults(command=_load)

    truth = commands.add_parser("truth", help="print what is hidden from the daemon, as JSON")
    _add_setup(truth)
    truth.set_defaults(command=_truth)

    score = commands.add_parser("score", help="compare results with the truth, as JSON")
    _add_setup(score)
    score.add_argument("--cloud", type=Path, metavar="PLY", help="a merged cloud in the robot's base frame")
    score.add_argument("--calibration", type=Path, metavar="JSON", help="a calibration.json")
    score.set_defaults(command=_score)

    faults = commands.add_parser("faults", help="list the faults there are")
    faults.add_argument("--json", action="store_true")
    faults.set_defaults(command=_faults)
    return parser


def _add_setup(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--arm", choices=ARM_CLASSES, default="perfect", help="the arm as built: as drawn, ...")
    parser.add_argument("--camera", action="append", default=[], metavar="NAME", help="a further camera; repeatable")
    parser.add_argument(
        "--scanner", action="append", default=[], metavar="NAME", help="a scanner that sees the target; repeatable"
    )
    parser.add_argument("--beside", choices=("track", "turntable"), help="what the controller leaves out of its poses")
    parser.add_argument("--scara", action="store_true", help="the arm turns its flange about the vertical only")
    parser.add_argument(
        "--setup", choices=("eye-in-hand", "eye-to-hand"), default="eye-in-hand",
        help="camera on the flange, or on a stand with the target on the flange",
    )  # fmt: skip


def _truth_of(options: argparse.Namespace) -> "CellTruth":
    from mock_robot.cabinet.cabinet import Mounting
    from mock_robot.truth.truth import CellTruth

    truth = CellTruth.from_seed(options.seed, arm_class=options.arm, setup=options.setup)
    beside = {"mounting": Mounting.with_axis(options.beside), "scara": options.scara}
    return replace(truth.beside(options.camera, options.scanner), **beside)


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and up to 1000")
    return value


def _folder(text: str) -> Path:
    if not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text} is no folder")
    return Path(text)


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"{text} is not a port: 0 (chosen by the system) to 65535")
    return int(text)


def _own_address(text: str) -> str:
    try:
        socket.create_server((text, 0)).close()
    except (OSError, UnicodeError):
        raise argparse.ArgumentTypeError(
            f"{text} is no address of this machine: give one, or 0.0.0.0 for all"
        ) from None
    return text


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or _port(port) == 0:
        raise argparse.ArgumentTypeError(f"{text} is not HOST:PORT")
    return host, int(port)


def _run(options: argparse.Namespace) -> int:
    from mock_robot.process import run_cell  # imports the renderer, which only `run` needs

    return asyncio.run(run_cell(options, _truth_of(options)))


def _load(options: argparse.Namespace) -> int:
    from mock_robot.rapid.home import load_problems

    count, problems = load_problems(options.folder)
    if options.json:
        _print(json.dumps({"modules": count, "problems": [vars(problem) for problem in problems]}))
    else:
        for problem in problems:
            _print(f"{problem.file}: {problem.what.splitlines()[0]}")
        _print(f"{count - len(problems)} of {count} modules load")
    return int(bool(problems))


def _truth(options: argparse.Namespace) -> int:
    from mock_robot.truth.truth_sheet import truth_document

    _print(json.dumps(truth_document(_truth_of(options)), indent=2))
    return 0


def _score(options: argparse.Namespace) -> int:
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.validation import parse_document
    from calibration.errors import CalibrationError
    from calibration.problem import MOUNTS
    from mock_robot.truth.score import score_calibration, score_cloud

    if options.cloud is None and options.calibration is None:
        raise MockError("nothing to score: give --cloud PLY, --calibration JSON, or both")
    truth = _truth_of(options)
    scores: dict[str, Any] = {"seed": options.seed}
    try:
        if options.calibration is not None:
            path = options.calibration
            calibration = parse_document(CalibrationDocument, path.read_bytes(), str(path))
            if calibration.setup != truth.setup or calibration.mount_T_camera is None:
                raise MockError(f"{path} holds no {MOUNTS[truth.setup]}_T_camera, which the truth of this cell has")
            scores["calibration"] = score_calibration(truth, calibration.mount_T_camera.transform())
        if options.cloud is not None:
            scores["cloud"] = score_cloud(truth, options.cloud.read_bytes())
    except (ValueError, CalibrationError) as error:
        raise MockError(str(error)) from error
    _print(json.dumps(scores, indent=2))
    return 0


def _faults(options: argparse.Namespace) -> int:
    from mock_robot.faults.tables import DEVICE_FAULTS, FAULTS

    rows = [(fault.name, fault.area, fault.summary) for fault in (*FAULTS.values(), *DEVICE_FAULTS.values())]
    if options.json:
        _print(json.dumps([dict(zip(("name", "area", "summary"), row, strict=True)) for row in rows], indent=2))
        return 0
    width = max(len(name) for name, _, _ in rows)
    for name, _, summary in rows:
        _print(f"{name:{width}}  {summary}")
    return 0


def _print(text: str) -> None:
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
