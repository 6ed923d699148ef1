"""ABB's published serial six-axis arms, by name.

Lengths and limits as RobotComponents' presets (ABB.Presets) list them; a test compares each with the reach in its name.
Where ros-industrial's abb and abb_experimental (abb_*_support/urdf; the speeds are theirs) describe the same arm, they
agree, but for the IRB 1600, where the presets swap the limits of the long and the short arm; here they are as in ABB's
product specification 3HAC023604-001. `evidence_of` says what each arm was compared with and what is doubtful.
Not included: arms with a parallel rod, whose axis 3 is limited together with axis 2 (IRB 2400, 4400), and any whose
published lengths do not give its reach (IRB 6700-245).
"""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from calibration.errors import GeometryError
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_row import SLOWEST, read_arm_row
from calibration.kinematics.seven_axes import IRB_14050, AnyArm, SevenAxisArm

_SHEET = """
name                | forward height  lower  elbow forearm flange | axes 1 to 6
IRB 1010-1.5/0.37   |      0    190    185      0    185     45 | 170  -75/125  -180/50      170      125 242
IRB 1100-4/0.475    |      0    327    225     10    250     64 | 230 -115/113  -205/55      230 -125/120 400
IRB 1100-4/0.58     |      0    327    280     10    300     64 | 230 -115/113  -205/55      230 -125/120 400
CRB 1100-4/0.475    |      0    327    225     10    250     64 | 230 -115/113  -205/55      230 -125/120 400
CRB 1100-4/0.58     |      0    327    280     10    300     64 | 230 -115/113  -205/55      230 -125/120 400
CRB 15000-5/0.95    |      0    265    444    110    470    101  80 | 180    180  -225/85      180      180 270
CRB 15000-12/1.27   |      0    338    707    110    534    101  80 | 270    180  -225/85      180      180 270
CRB 15000-10/1.52   |    150    400    707    110    637    101  80 | 270    180  -225/85      180      180 270
IRB 120-3/0.6       |      0    290    270     70    302     72 | 165      110  -110/70      160      120 400
IRB 1200-5/0.9      |      0  399.1    448     42    451     82 | 170 -100/130  -200/70      270      130 400
IRB 1200-7/0.7      |      0  399.1    350     42    351     82 | 170 -100/135  -200/70      270      130 360
IRB 1300-11/0.9     |     50    544    425     40    425     90 | 180 -100/130  -210/65      230      130 400
IRB 1300-10/1.15    |    150    544    575     40    425     90 | 180  -95/155  -210/65      230      130 400
IRB 1300-7/1.4      |    150    544    575     40    675     90 | 180  -95/155  -210/69      230      130 400
IRB 140-6/0.8       |     70    352    360      0    380     65 | 180  -90/110  -230/50      200      115 400
IRB 1520ID-4/1.5    |    160    453    590    200    723    200 | 170  -90/150  -100/80      155      135 200
IRB 1600-6/1.2      |    150  486.5    475      0    600     65 | 180  -63/110  -235/55      200      115 400
IRB 1600-10/1.2     |    150  486.5    475      0    600     65 | 180  -63/110  -235/55      200      115 400
IRB 1600-6/1.45     |    150  486.5    700      0    600     65 | 180  -90/120  -245/65      200      115 400
IRB 1600-10/1.45    |    150  486.5    700      0    600     65 | 180  -90/120  -245/65      200      115 400
IRB 1660ID-4/1.55   |    150  486.5    700    110    678    135 | 180  -90/150  -238/79      175      120 400
IRB 1660ID-6/1.55   |    150  486.5    700    110    678    135 | 180  -90/150  -238/79      175      120 400
IRB 2600-12/1.65    |    150    445    700    115    795     85 | 180  -95/155  -180/75      400      120 400
IRB 2600-20/1.65    |    150    445    700    115    795     85 | 180  -95/155  -180/75      400      120 400
IRB 2600-12/1.85    |    150    445    900    115    795     85 | 180  -95/155  -180/75      400      120 400
IRB 2600ID-15/1.85  |    150    445    900    150    786    135 | 180  -95/155  -180/75      175      120 400
IRB 2600ID-8/2.0    |    150    445    900    150    938    200 | 180  -95/155  -180/75      175      120 400
IRB 4600-20/2.5     |    175    495   1095    175 1230.5     85 | 180  -90/150  -180/75      400      120 400
IRB 4600-40/2.55    |    175    495   1095    175   1270    135 | 180  -90/150  -180/75      400 -125/120 400
IRB 4600-45/2.05    |    175    495    900    175    960    135 | 180  -90/150  -180/75      400 -125/120 400
IRB 4600-60/2.05    |    175    495    900    175    960    135 | 180  -90/150  -180/75      400 -125/120 400
IRB 5710-110/2.3    |    280    670    950    180   1055    167 | 170  -75/145  -180/70      300      130 360
IRB 5710-90/2.3 LID |    280    670    950    180   1055    333 | 170  -75/145  -160/70      300      120 200
IRB 5710-90/2.7     |    280    670    950    180   1460    160 | 170  -75/145  -180/70      300      130 360
IRB 5710-70/2.7 LID |    280    670    950    180   1460    290 | 170  -75/145  -160/70      300      120 200
IRB 5720-180/2.6    |    320    670   1120    200 1142.5    180 | 170  -75/145  -180/70      300      130 360
IRB 5720-155/2.6 LID|    320    670   1120    200 1142.5    346 | 170  -75/145  -160/70      300      120 200
IRB 5720-125/3.0    |    320    670   1120    200 1547.5    167 | 170  -75/145  -180/70      300      130 360
IRB 5720-90/3.0 LID |    320    670   1120    200 1547.5    333 | 170  -75/145  -160/70      300      120 200
IRB 6620-150/2.2    |    320    680    975    200    887    200 | 170  -65/140  -180/70      300      130 300
IRB 6640-235/2.55   |    320    780   1075    200 1142.5    200 | 170   -65/85  -180/70      300      120 360
IRB 6640-185/2.8    |    320    780   1075    200 1392.5    200 | 170   -65/85  -180/70      300      120 360
IRB 6650-200/2.75   |    320    780   1280    200   1142    200 | 170   -65/85  -180/70      300      120 360
IRB 6650-125/3.2    |    320    780   1280    200   1592    200 | 180   -65/85  -180/70      300      120 360
IRB 6650S-200/3.0   |    600    630   1280    200   1142    200 | 180  -40/160  -180/70      300      120 360
IRB 6650S-125/3.5   |    600    630   1280    200   1592    200 | 180  -40/160  -180/70      300      120 360
IRB 6650S-90/3.9    |    600    630   1280    200   2042    200 | 180  -40/160  -180/70      300      120 360
IRB 6700-200/2.60   |    320    780   1125    200 1142.5    200 | 170   -65/85  -180/70      300      130 360
IRB 6700-235/2.65   |    320    780   1135    200 1182.5    200 | 170   -65/85  -180/70      300      130 360
IRB 6700-300/2.70   |    320    780   1145    200 1212.5    250 | 170   -65/85  -180/70      300      130 360
IRB 6700-205/2.80   |    320    780   1280    200 1182.5    200 | 170   -65/85  -180/70      300      130 360
IRB 6700-155/2.85   |    320    780   1125    200 1392.5    200 | 170   -65/85  -180/70      300      130 360
IRB 6700-175/3.05   |    320    780   1135    200 1592.5    200 | 170   -65/85  -180/70      300      130 360
IRB 6700-150/3.20   |    320    780   1280    200 1592.5    200 | 170   -65/85  -180/70      300      130 360
IRB 6790-235/2.65   |    320    780   1135    200 1182.5    200 | 170   -65/85  -180/70      300      130 360
IRB 6790-205/2.80   |    320    780   1280    200 1182.5    200 | 170   -65/85  -180/70      300      130 360
IRB 7600-400/2.55   |    410    780   1075    165   1056    250 | 180   -60/85  -180/60      300      100 360
IRB 7600-500/2.55   |    410    780   1075    165   1056    250 | 180   -60/85  -180/60      300      100 360
IRB 7600-340/2.8    |    410    780   1075    165   1306    250 | 180   -60/85  -180/60      300      100 360
IRB 7600-325/3.1    |    410    780   1075    165   1556    250 | 180   -60/85  -180/60      300      100 360
IRB 7600-150/3.5    |    410    780   1075    165   2012    250 | 180   -60/85  -180/60      300      100 360
"""
"""Base to axis 2 forward and up, lower arm, axis 4 above axis 3, forearm, wrist to flange, and axis 6 above axis 4
where they do not meet, in mm; limits in deg."""

_SPEEDS = {
    "CRB 15000-5/0.95": "125 125 140 200 200 200",
    "CRB 15000-12/1.27": "125 125 140 200 200 200",
    "IRB 120-3/0.6": "250 250 250 320 320 420",
    "IRB 1600-6/1.2": "150 160 170 320 400 450",
    "IRB 1600-6/1.45": "150 160 170 320 400 450",
    "IRB 2600-12/1.65": "175 175 175 360 360 500",
    "IRB 6650S-125/3.5": "110 90 90 150 120 235",
    "IRB 6650S-90/3.9": "100 90 90 150 120 235",
    "IRB 6700-200/2.60": "110 110 110 190 150 210",
    "IRB 6700-235/2.65": "100 90 90 170 120 190",
    "IRB 7600-150/3.5": "100 60 60 100 100 190",
}
"""Speeds of axes 1 to 6 in deg/s where the sources have them; the others get the slowest. Only the mock uses them."""


_URDF = "ros-industrial abb, urdf"
_CHECKED = {
    "CRB 15000-5/0.95": f"{_URDF} (axis 6 ± 180 there); limits by ABB's data sheet 9AKK107991A8564 as cited in a"
    " public program, axis 6 ± 270",
    "CRB 15000-12/1.27": f"{_URDF} of abb_experimental (axes 1 and 6 ± 180 there); ± 270 in a second public program,"
    " robotkinematicscatalogue",
    "IRB 120-3/0.6": f"{_URDF}; MOC.cfg of PaulaFreudenberger/ABB-Rapid-Git, joseballester/abb-rapidserver",
    "IRB 1200-5/0.9": f"{_URDF}; MOC.cfg of panin-anan/abb_SAMXL_Grinding_RAPID (axis 6 ± 400)",
    "IRB 1600-6/1.2": f"{_URDF}; 3HAC023604-001",
    "IRB 1600-6/1.45": f"{_URDF}; 3HAC023604-001",
    "IRB 4600-40/2.55": f"{_URDF}; MOC.cfg of tetov/compas_rcf (axis 5 -125/120)",
    "IRB 4600-60/2.05": _URDF,
    "IRB 6640-185/2.8": _URDF,
    "IRB 6650S-125/3.5": _URDF,
    "IRB 6650S-90/3.9": _URDF,
    "IRB 6700-200/2.60": _URDF,
    "IRB 6700-205/2.80": f"{_URDF}; backup of Fabio-Coder/Robo_ABB_Injetora-Rotinas_de_ajuste",
    "IRB 6700-235/2.65": _URDF,
    "IRB 7600-150/3.5": _URDF,
}
_DOUBTFUL = {
    "CRB 15000-10/1.52": "the urdf of abb_experimental has the lengths of the CRB 15000-5, which do not give its reach",
    "IRB 1200-7/0.7": "axis 6 ± 360, while the IRB 1200-5/0.9 has ± 400",
    "IRB 2600-12/1.65": "axes 2 and 3 differ from the urdf",
    "IRB 4600-20/2.5": "axis 5 ± 120, the urdf has -125/120",
    "IRB 6650-125/3.2": "axis 1 ± 180, while the IRB 6650-200/2.75 has ± 170",
    "CRB 1100-4/0.475": "taken from the IRB 1100, of which SWIFTI is the collaborative version",
    "CRB 1100-4/0.58": "taken from the IRB 1100, of which SWIFTI is the collaborative version",
}


@dataclass(frozen=True)
class Evidence:
    """What an arm's numbers were compared with. `state`: checked, doubtful, or not checked against a second source."""

    state: Literal["checked", "doubtful", "single source"]
    source: str


def evidence_of(name: str) -> Evidence:
    """The evidence for an arm of this list."""
    if name in _CHECKED:
        return Evidence("checked", f"ABB.Presets; {_CHECKED[name]}")
    if name in _DOUBTFUL:
        return Evidence("doubtful", f"ABB.Presets; {_DOUBTFUL[name]}")
    return Evidence("single source", "ABB.Presets")


def _arm(line: str) -> Arm:
    name = line.partition("|")[0].strip()
    return read_arm_row(f"{line} | {_SPEEDS.get(name, SLOWEST)}")


ARMS: Mapping[str, Arm] = MappingProxyType({arm.name: arm for arm in map(_arm, _SHEET.splitlines()[2:])})


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
