"""MATLAB files that nest or unpack to more than a set of poses does, and those of scipy.io.savemat."""

import io
import sys
from collections.abc import Iterator

import numpy as np
import pytest
import scipy.io

from calibration.documents.imports.pose_files import read_mat
from calibration.errors import DocumentError
from tests.calibration.documents.imports.written import POSES


@pytest.fixture
def _deep_calls() -> Iterator[None]:
    """So that SciPy writes what it is to read."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(20_000)
    yield
    sys.setrecursionlimit(before)


def file_of(**arrays: object) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, arrays, do_compression=True)
    return stream.getvalue()


@pytest.mark.usefixtures("_deep_calls")
@pytest.mark.parametrize("depth", [50, 900])
def test_cells_within_cells_are_refused_in_words(depth: int) -> None:
    cell = np.eye(4)
    for _ in range(depth):
        outer = np.empty((1, 1), object)
        outer[0, 0] = cell
        cell = outer
    content = file_of(T=cell)
    sys.setrecursionlimit(1000)
    with pytest.raises(DocumentError, match=r"nests too deep|recursion depth"):
        read_mat(content, "deep.mat")


@pytest.mark.parametrize("sizes", [(3000,), (2100, 2100)], ids=["one array", "all arrays"])
def test_more_than_64_mb_are_refused(sizes: tuple[int, ...]) -> None:
    content = file_of(**{f"a{at}": np.zeros((size, size)) for at, size in enumerate(sizes)}, T=np.eye(4))
    with pytest.raises(DocumentError, match="more than 64 MB"):
        read_mat(content, "large.mat")


@pytest.mark.parametrize("views_first", [True, False])
def test_arrays_have_the_views_first_or_last(views_first: bool) -> None:
    poses = np.concatenate([POSES, POSES[::-1]])
    turns, places = poses[:, :3, :3], poses[:, :3, 3:] / 1000
    seen = {"R_target2cam": np.swapaxes(turns, 1, 2), "t_target2cam": 2 * places}
    arrays = {"R_gripper2base": turns, "t_gripper2base": places, **seen}
    result = {"R_cam2gripper": np.eye(3), "t_cam2gripper": np.ones((3, 1))}
    written = {name: one if views_first else np.moveaxis(one, 0, 2) for name, one in arrays.items()}
    table = read_mat(file_of(**result, **written), "a.mat")
    assert table.camera is not None
    np.testing.assert_allclose(table.lengths, places[:, :, 0])
    np.testing.assert_allclose(table.camera.numbers, seen["R_target2cam"].reshape(-1, 9))
