"""Errors survive pickling, for they cross processes; their words and data stay."""

import pickle

import pytest

from calibration.errors import (
    ComparisonError,
    DetectionError,
    DocumentError,
    DocumentProblem,
    GeometryError,
    UndeterminedError,
)
from registration.errors import CloudTruncated, SphereError

ERRORS = (
    DocumentError("session.json", [DocumentProblem("views[2]", "missing", "add it")]),
    DetectionError("target-not-found", "no target", "light it"),
    GeometryError("not a rotation"),
    ComparisonError("calibration c1 holds no transform", "compare two that do"),
    UndeterminedError("parallel-axes", "all turns are about one axis", "turn about another"),
    CloudTruncated("door.ply", "point 3", "the data end", "send it again"),
    SphereError("not a sphere", "check the radius"),
)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_is_the_same_in_another_process(error: Exception) -> None:
    unpickled = pickle.loads(pickle.dumps(error))
    assert (type(unpickled), str(unpickled), vars(unpickled)) == (type(error), str(error), vars(error))
