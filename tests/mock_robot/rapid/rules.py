"""Controller limits that a syntax check misses, and rules of the project, as a table of patterns."""

import re
from dataclasses import dataclass

MAX_STRING_LENGTH = 80
MAX_NAME_LENGTH = 32
MAX_INTEGER = 8388608


@dataclass(frozen=True)
class Offence:
    """A line that a controller would refuse or that the project does not allow, with the reason."""

    line: int
    why: str


_FORBIDDEN = (
    (re.compile(rf"\b[A-Za-z]\w{{{MAX_NAME_LENGTH},}}"), f"a name of more than {MAX_NAME_LENGTH} characters"),
    (re.compile(rf'"[^"]{{{MAX_STRING_LENGTH + 1},}}"'), f"a string of more than {MAX_STRING_LENGTH} characters"),
    (re.compile(r"\bSocket(Receive|Accept)\b(?!.*\\Time:=)", re.I), "waits 60 s: give \\Time"),
    (re.compile(r"\bReadBin\b(?!.*\\Time:=)", re.I), "waits 60 s: give \\Time"),
    (re.compile(r"\bSocketReceive\b.*\\Str\b", re.I), "\\Str cuts at 80 characters: use \\RawData"),
    (re.compile(r"\bStopMove\s*\\Quick\b", re.I), "RobotWare 7 does not load \\Quick"),
    (re.compile(r"(?<!sing\.wrist )\bSingArea\s*\\Wrist\b", re.I), "the orientation would leave the path"),
    (re.compile(r"\bRETRY\s*;", re.I), "RETRY does the failed instruction once more, a motion too"),
    (re.compile(r"\bCRobT\((?!.*\\Tool:=.*\\WObj:=)", re.I), "tool and work object must be named"),
)
_ROUTINE = re.compile(r"^\s*(?:LOCAL\s+)?(PROC|FUNC|TRAP)\b.*?^\s*END\1\b", re.M | re.S | re.I)
_INTEGER = re.compile(r"(?<![\w.])\d+(?![\w.])")


def offences(source: bytes) -> list[Offence]:
    """Violations of the rules in a module's file, by line."""
    found = []
    for number, raw in enumerate(source.split(b"\n")[:-1], 1):
        if not raw.isascii():
            found.append(Offence(number, "not ASCII"))
        if not raw.endswith(b"\r"):
            found.append(Offence(number, "the line does not end with CR LF"))
    text = source.decode("latin-1").replace("\r\n", "\n")
    for number, line in enumerate(text.split("\n"), 1):
        code = line.split("!")[0].rstrip()
        found += [Offence(number, why) for pattern, why in _FORBIDDEN if pattern.search(code)]
        if any(int(literal) > MAX_INTEGER for literal in _INTEGER.findall(re.sub(r'"[^"]*"', "", code))):
            found.append(Offence(number, f"a num is exact up to {MAX_INTEGER} only"))
    for routine in _ROUTINE.finditer(text):
        if not re.search(r"^\s*ERROR\s*(\(\w+\)\s*)?$", routine[0], re.M | re.I):
            line_number = text.count("\n", 0, routine.start(1)) + 1
            found.append(Offence(line_number, f"a {routine[1]} without ERROR: any error in it stops the program"))
    return sorted(found, key=lambda offence: offence.line)
