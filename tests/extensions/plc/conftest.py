"""As in the daemon's room, each problem is solved once."""

from tests.daemon.conftest import computed_results, each_problem_is_solved_once

__all__ = ["computed_results", "each_problem_is_solved_once"]
