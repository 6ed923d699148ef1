"""ABB's published serial six-axis arms, by name.

Lengths and limits as RobotComponents' presets (ABB.Presets) list them; a test compares each with the reach in its name.
Where ros-industrial's abb and abb_experimental (abb_*_support/urdf; the speeds are theirs) describe the same arm, they
agree, but for the IRB 1600, where the presets swap the limits of the long and the short arm; here they are as in ABB's
product specification 3HAC023604-001. `arm_evidence` says what each arm was compared with and what is doubtful.
Not included: arms with a parallel rod, whose axis 3 is limited together with axis 2 (IRB 2400, 4400), and any whose
published lengths do not give its reach (IRB 6700-245).
"""

import difflib
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from calibration.errors import GeometryError
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_row import SLOWEST, read_arm_row
from calibration.kinematics.seven_axes import IRB_14050, AnyArm, SevenAxisArm

_SHEET = Path(__file__).with_suffix(".txt").read_text("utf-8")
"""Base to axis 2 forward and up, lower arm, axis 4 above axis 3, forearm, wrist to flange, and axis 6 above axis 4
where they do not meet, in mm; limits in deg."""

_SPEEDS: dict[str, str] = json.loads(Path(__file__).with_name("abb_arms_speeds.json").read_text("utf-8"))
"""Speeds of axes 1 to 6 in deg/s where the sources have them; the others get the slowest. Only the mock uses them."""


def _arm(line: str) -> Arm:
    name = line.partition("|")[0].strip()
    return read_arm_row(f"{line} | {_SPEEDS.get(name, SLOWEST)}")


ARMS: Mapping[str, Arm] = MappingProxyType({arm.name: arm for arm in map(_arm, _SHEET.splitlines()[1:])})


SEVEN_AXIS_ARMS: Mapping[str, SevenAxisArm] = MappingProxyType({IRB_14050.name: IRB_14050})


def find_arm(name: str) -> Arm:
    """The arm with six axes of that name, ignoring case, spaces and trailing zeros, or of that line (`read_arm_row`).

    Raises GeometryError with the nearest names, or with what is wrong in the line.
    """
    found = find_any_arm(name)
    if isinstance(found, SevenAxisArm):
        raise GeometryError(f"{found.name} has seven axes, and six are needed here: its poses are taught, not planned")
    return found


def find_any_arm(name: str) -> AnyArm:
    """As `find_arm`, with the arms that have seven axes."""
    if "|" in name:
        return replace(read_arm_row(name), row=name)
    listed: dict[str, AnyArm] = {**ARMS, **SEVEN_AXIS_ARMS}
    known = {_plain(each): arm for each, arm in listed.items()}
    try:
        return known[_plain(name)]
    except KeyError:
        nearest = difflib.get_close_matches(_plain(name), known, n=3, cutoff=0.5)
        like = f"; near are {', '.join(known[each].name for each in nearest)}" if nearest else ""
        others = "`handeyed arms` lists all, `handeyed arms --from FILE` describes one of your own"
        raise GeometryError(f"no arm is named {name!r}{like} ({others})") from None


def _plain(name: str) -> str:
    """A name in capitals without spaces and trailing zeros: IRB 2600ID-8/2.00 and irb2600id-8/2.0 agree."""
    return re.sub(r"(\.\d*?)0+(?=\D|$)", r"\1", re.sub(r"\s", "", name.upper()))
