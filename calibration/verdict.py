"""May a solution be used? A table of rules over the solution; judging never solves."""

from calibration.problem import Problem
from calibration.solution import Solution, Verdict


def judge(problem: Problem, solution: Solution) -> Verdict:
    """The solution's own findings and those of the rules; accepted when none of them is an error."""
    findings = solution.findings
    accepted = solution.mount_T_camera is not None and not any(finding.severity == "error" for finding in findings)
    return Verdict(accepted, findings)
