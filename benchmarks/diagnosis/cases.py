"""One fault in one session, of several sizes: what is said of it, and what the oracle could have said."""

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

CAUSES = CHANGE_CODES | {convention.code for convention in CONVENTIONS}
CAUSES |= {"poses-off-by-one", "poses-swapped", "pose-mistyped", "board-turned", "intrinsics-do-not-fit"}
SIZE = frozenset({"wrong-pitch", "target-scale"})
CAUSES |= SIZE


@dataclass(frozen=True, eq=False)
class Case:
    """A fault of this kind is put into the session; `factors`: its sizes, none for a gross one."""

    kind: str
    session: Session
    factors: tuple[float, ...]
    seed: tuple[int, ...]

    def rng(self) -> np.random.Generator:
        """Its own, whatever else runs, and wherever."""
        return np.random.default_rng([*self.seed, zlib.crc32(self.kind.encode())])


@dataclass(frozen=True)
class Result:
    """What came of one size: `outcome`, see `named`; `power`: the oracle's, nan where there is none.

    `told_apart`: is there a size from which on the oracle is right in 99 of 100; `deviations`: the size in the
    session's own standard deviations; `said`: the findings, for people.
    """

    outcome: str
    power: float = float("nan")
    deviations: float = float("nan")
    told_apart: bool = True
    said: str = ""


def results_of(case: Case) -> list[Result]:
    """One for each factor; for a gross fault one."""
    problem, before = case.session.problem, case.session.before
    if case.kind in GROSS:
        return [_result(GROSS[case.kind](problem, case.rng()), before)]
    kind = KINDS[case.kind]
    slip = kind.slip_of(problem, case.rng())
    reach = kind.reach(case.session, slip)
    results = []
    for factor in case.factors:
        size = factor * reach.size
        seen = _result(slip.at(size * reach.deviation), before) if reach.told_apart else Result("none")
        results.append(replace(seen, power=reach.power(size), deviations=size, told_apart=reach.told_apart))
    return results


def with_what_is_said(session: Session) -> Session:
    """What is said of a session that has no fault; where that is its target's size, it is taken out first.

    A slip of the pitch that undid it would be none.
    """
    said = frozenset(finding.code for finding in causes(session.problem))
    if not said & SIZE:
        return replace(session, before=said)
    poses, size = poses_of(session.problem), likeliest_scale(clean_fit(session.problem)[0])
    problem = with_poses(session.problem, transform(poses[:, :3, :3], poses[:, :3, 3] / size))
    return replace(session, problem=problem, before=frozenset(finding.code for finding in causes(problem)))


def causes(problem: Problem) -> list[Finding]:
    """What the solver says is wrong with a session."""
    return [finding for finding in solve_hand_eye(problem).findings if finding.code in CAUSES]


def _result(fault: Fault, before: Set[str]) -> Result:
    found = causes(fault.problem)
    said = " | ".join(f"{finding.code}: {finding.message}" for finding in found)
    return Result(named(found, fault, before), said=f"{', '.join((*sorted(fault.codes), *fault.says))} -> {said}")


def named(found: list[Finding], fault: Fault, before: Set[str]) -> str:
    """Right, when the cause is named with its views; either, when they are told to be nearly as likely as what is.

    What is said of the clean session, the codes `before`, does not count against it.
    """
    found = [finding for finding in found if finding.code in fault.codes or finding.code not in before]
    if not found:
        return "none"
    telling = [finding for finding in found if all(_says(finding, words) for words in fault.says)]
    if any(finding.code in fault.codes for finding in telling):
        return "right"
    either = telling if fault.says else []
    either += [f for f in found if f.code in fault.codes and fault.after is not None and fault.after in _views(f)]
    return "either" if either else "wrong"


def _says(finding: Finding, words: str) -> bool:
    """View 2 is not view 20; what else it may have been, view 2 (or 3), does not matter."""
    told = re.sub(r" \(or [\d, ]+\)", "", finding.message)
    return re.search(re.escape(words) + r"(?!\d)", told) is not None


def _views(finding: Finding) -> set[int]:
    """Those before which a change may have been: 7 (or 8); 7 (or 6, 8)."""
    told = re.search(r"view (\d+(?: \(or [\d, ]+\))?)", finding.message)
    return {int(view) for view in re.findall(r"\d+", told.group(1))} if told else set()
