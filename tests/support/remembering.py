"""Expensive computations done once in a test process."""

import hashlib
import pickle
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")


def remembering(function: Callable[Arguments, Answer]) -> Callable[Arguments, Answer]:
    """`function`, computed once for equal arguments.

    For pure functions whose results nobody changes. Arguments that cannot be pickled are computed
    each time; so is what raised an exception.
    """
    answers: dict[bytes, Answer] = {}

    @wraps(function)
    def remembered(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        try:
            key = hashlib.sha256(pickle.dumps((args, kwargs))).digest()
        except (pickle.PicklingError, AttributeError, TypeError):
            return function(*args, **kwargs)
        if key not in answers:
            answers[key] = function(*args, **kwargs)
        return answers[key]

    return remembered
