"""One fault of several sizes in one session: the diagnosis, and what an oracle could have found."""

import re
import zlib
from collections.abc import Set
from dataclasses import dataclass, replace

import numpy as np

from calibration.diagnosis.convention_hypotheses import CONVENTIONS, likeliest_scale
from calibration.diagnosis.view_hypotheses import CHANGE_CODES
from calibration.problem import Problem
from calibration.solution import Finding
from calibration.solve import solve_hand_eye
from calibration.transforms import transform
from tests.simulated.fault_kinds import GROSS, KINDS, Session
from tests.simulated.faults import Fault, clean_fit, poses_of, with_poses
from tests.simulated.mixups import MIXUPS, OF_INTRINSICS

CAUSES = CHANGE_CODES | {convention.code for convention in CONVENTIONS}
CAUSES |= {"setup-swapped", "poses-shifted", "poses-reversed", "poses-in-lexical-order", "poses-blocks-swapped"}
CAUSES |= {"rotation-transposed", "euler-order", "vector-read-as-euler", "euler-read-as-vector"}
CAUSES |= {"quaternion-w-first", "target-not-as-described", "pictures-mirrored", "pictures-turned", "images-repeated"}
CAUSES |= {
    "track-not-declared",
    "poses-off-by-one",
    "poses-swapped",
    "pose-mistyped",
    "board-turned",
    "intrinsics-do-not-fit",
}
NOTHING = "nothing"
"""The kind of a session without a fault: right when no cause is named."""

POSTURES = ("stood in another posture", "no other picture has its posture")
"""Words by which the sentences are recognised that name the posture as the other of two causes."""

SIZE = frozenset({"wrong-pitch", "target-scale"})
CAUSES |= SIZE


@dataclass(frozen=True, eq=False)
class Case:
    """A fault of this kind in the session; `factors`: its sizes, empty for a gross one."""

    kind: str
    session: Session
    factors: tuple[float, ...]
    seed: tuple[int, ...]

    def rng(self) -> np.random.Generator:
        """A generator of its own, independent of the order of execution."""
        return np.random.default_rng([*self.seed, zlib.crc32(self.kind.encode())])


@dataclass(frozen=True)
class Result:
    """Result at one size: `outcome` as in `named`; `power` of the oracle, nan without one.

    `detectable`: whether the oracle is right in 99 of 100 at some size; `deviations`: the size in the session's own
    standard deviations; `said`: the findings as text.
    """

    outcome: str
    power: float = float("nan")
    deviations: float = float("nan")
    detectable: bool = True
    said: str = ""


def results_of(case: Case) -> list[Result]:
    """One result per factor; one for a gross fault."""
    problem, before = case.session.problem, case.session.before
    if case.kind == NOTHING:
        found = causes(problem)
        said = " | ".join(f"{finding.code}: {finding.message}" for finding in found)
        return [Result(_outcome_of_nothing(found, case.session), said=said)]
    if case.kind in OF_INTRINSICS and problem.camera is None:
        return [Result("none", detectable=False)]
    if put := (GROSS | MIXUPS).get(case.kind):
        fault = put(problem, case.rng())
        return [replace(_result(fault, before), detectable=fault.changes(problem))]
    kind = KINDS[case.kind]
    slip = kind.slip_of(problem, case.rng())
    reach = kind.reach(case.session, slip)
    results = []
    for factor in case.factors:
        size = factor * reach.size
        seen = _result(slip.at(size * reach.deviation), before) if reach.told_apart else Result("none")
        results.append(replace(seen, power=reach.power(size), deviations=size, detectable=reach.told_apart))
    return results


def _outcome_of_nothing(found: list[Finding], session: Session) -> str:
    """Either, when all that is named is a view that the arm took in another posture than the others, and that is said
    as one of two causes."""
    if not found:
        return "right"
    views = {view for finding in found for view in _views(finding)}
    both = all(any(words in finding.message for words in POSTURES) for finding in found)
    return "either" if both and views <= session.turned_back else "wrong"


def with_corrected_size(session: Session) -> Session:
    """Findings of the session without a fault; a deviating target size among them is corrected first,

    so that a simulated error of the pitch cannot cancel it.
    """
    said = frozenset(finding.code for finding in causes(session.problem))
    if not said & SIZE:
        return replace(session, before=said)
    poses, size = poses_of(session.problem), likeliest_scale(clean_fit(session.problem)[0])
    problem = with_poses(session.problem, transform(poses[:, :3, :3], poses[:, :3, 3] / size))
    return replace(session, problem=problem, before=frozenset(finding.code for finding in causes(problem)))


def causes(problem: Problem) -> list[Finding]:
    """Causes found by the solver."""
    return [finding for finding in solve_hand_eye(problem).findings if finding.code in CAUSES]


def _result(fault: Fault, before: Set[str]) -> Result:
    found = causes(fault.problem)
    said = " | ".join(f"{finding.code}: {finding.message}" for finding in found)
    return Result(outcome_of(found, fault, before), said=f"{', '.join((*sorted(fault.codes), *fault.says))} -> {said}")


def outcome_of(found: list[Finding], fault: Fault, before: Set[str]) -> str:
    """Outcome: right, when the cause is named with its views; either, when reported as nearly as likely as the named.

    Codes found in the clean session (`before`) do not count.
    """
    found = [finding for finding in found if finding.code in fault.codes or finding.code not in before]
    if not found:
        return "none"
    if _is_right(found[0], fault):
        return "right"
    either = any(_is_right(finding, fault) for finding in found[1:]) or _offers(found[0], fault)
    return "either" if either else "wrong"


def _is_right(finding: Finding, fault: Fault) -> bool:
    says = all(_says(finding, words) for words in fault.says) and fault.fix in finding.fix
    return finding.code in fault.codes and says


def _offers(finding: Finding, fault: Fault) -> bool:
    """Whether the fault is named besides: as nearly as likely, or with its view among others."""
    if fault.says and all(_says(finding, words) for words in fault.says):
        return True
    if finding.code in fault.codes and fault.after is not None and fault.after in _views(finding):
        return True
    return any(OTHERWISE.get(code, code) in finding.message for code in fault.codes)


OTHERWISE = {
    "setup-swapped": "stands in the cell, which is",
    "poses-inverted": "the poses are inverted",
    "euler-order": "Euler angles in another order",
    "poses-shifted": "on the poses are off by one",
    "poses-off-by-one": "the poses are off by",
    "poses-reversed": "in reversed order",
    "poses-in-lexical-order": "in the order of their names as text",
    "poses-blocks-swapped": "two blocks of poses are swapped",
    "pictures-turned": "the pictures are turned",
}
"""Words by which a cause is recognised that is said beside another."""


def _says(finding: Finding, words: str) -> bool:
    """Whether the finding names the picture: 2 is not 20; alternatives, as in picture 2 (or 3), are ignored."""
    message = re.sub(r" \(or [\d, ]+\)", "", finding.message)
    return re.search(re.escape(words) + r"(?!\d)", message) is not None


def _views(finding: Finding) -> set[int]:
    """Indices of the pictures before which a change may have occurred: 6 and 7 of "7 (or 8)"."""
    views = re.search(r"picture (\d+(?: \(or [\d, ]+\))?)", finding.message)
    return {int(number) - 1 for number in re.findall(r"\d+", views.group(1))} if views else set()
