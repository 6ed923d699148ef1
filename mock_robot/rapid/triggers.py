"""triggdata: what happens at a distance from the start or the end of a move, or a time before its end."""

from collections.abc import Callable
from typing import Any

import numpy as np

from calibration.transforms import Array
from mock_robot.rapid.types import Atom


class Trigger:
    """Set by TriggInt, TriggIO and TriggEquip. `do` is called with the task that moves."""

    def __init__(self) -> None:
        self.distance = 0.0
        self.from_start = False
        self.timed = False
        self.do: Callable[[Any], None] = _nothing

    def set(self, distance: float, from_start: bool, timed: bool, do: Callable[[Any], None]) -> None:
        """Distance in mm, or seconds when it is `timed`."""
        self.distance, self.from_start, self.timed, self.do = distance, from_start, timed, do

    def fire(self, task: Any, here: Array, start: Array, end: Array, left_s: float) -> bool:
        """Whether it is due where the tool (3,) is now, and done."""
        if self.timed:
            due = left_s <= self.distance
        elif self.from_start:
            due = float(np.linalg.norm(here - start)) >= self.distance
        else:
            due = float(np.linalg.norm(end - here)) <= self.distance
        if due:
            self.do(task)
        return due


def _nothing(task: Any) -> None:
    """What a triggdata does that was not set."""


TRIGGDATA = Atom("triggdata", Trigger, device=True)
