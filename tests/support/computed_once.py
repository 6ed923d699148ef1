"""Pure functions computed once for equal arguments, for tests that meet the same pictures and problems again."""

import hashlib
import pickle
from collections.abc import Callable
from typing import Any


class ComputedOnce:
    """Calls `function`, which must be pure, and keeps its results by the content of the arguments.

    An exception is not kept: it is raised by the function each time. With `keeps` False everything is computed anew.
    """

    keeps = True

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._results: dict[bytes, Any] = {}

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if not self.keeps:
            return self._function(*arguments, **named)
        content = hashlib.blake2b(pickle.dumps((arguments, named))).digest()
        if content not in self._results:
            self._results[content] = self._function(*arguments, **named)
        return self._results[content]
