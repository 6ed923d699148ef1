"""Damaged files are one typed error with place, what is wrong and what to do, or poses; nothing else. No pickles."""

import io
import json
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.documents.imports.intrinsics import read_intrinsics
from calibration.documents.imports.pose_files import FAMILIES, MAX_ARRAY_BYTES, read_poses
from calibration.documents.imports.pose_table import PoseTable
from calibration.errors import DocumentError
from tests.calibration.documents.imports.written import FILES, npy

CASES = sorted(FILES)


def attempt(name: str, content: bytes) -> PoseTable | None:
    """The table, or None after a well-formed refusal."""
    try:
        table = read_poses(name, content)
    except DocumentError as error:
        (problem,) = error.problems
        assert problem.place
        assert problem.what
        assert "docs/formats.md#" in problem.fix
        return None
    assert np.isfinite(table.lengths).all()
    assert np.isfinite(table.numbers).all()
    return table


@settings(max_examples=150, deadline=None)
@given(case=st.sampled_from(CASES), data=st.data())
def test_a_damaged_file_is_refused_or_read(case: str, data: st.DataObject) -> None:
    name, content, _ = FILES[case]
    damaged = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, max(len(damaged) - 1, 0)))
        match data.draw(st.sampled_from(("flip", "cut", "remove", "repeat"))):
            case "flip":
                damaged[at : at + 1] = bytes([data.draw(st.integers(0, 255))])
            case "cut":
                del damaged[at:]
            case "remove":
                del damaged[at : at + data.draw(st.integers(1, 30))]
            case _:
                damaged[at:at] = damaged[max(at - 20, 0) : at]
    attempt(name, bytes(damaged))


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(suffix=st.sampled_from(sorted(FAMILIES)), content=st.one_of(st.binary(max_size=300), st.text().map(str.encode)))
def test_anything_at_all_is_refused_or_read(suffix: str, content: bytes) -> None:
    attempt(f"a{suffix}", content)


@settings(max_examples=60, deadline=None)
@given(
    data=st.recursive(
        st.none() | st.booleans() | st.floats() | st.text("xyzqwrabc_0123", max_size=6),
        lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text("xyzqwrt", max_size=3), inner, max_size=5),
    )
)
def test_any_data_are_refused_or_read(data: object) -> None:
    attempt("a.json", json.dumps(data).encode())


@settings(max_examples=100, deadline=None)
@given(suffix=st.sampled_from((".json", ".yaml", ".xml")), content=st.binary(max_size=200))
def test_intrinsics_likewise(suffix: str, content: bytes) -> None:
    with pytest.raises(DocumentError) as raised:
        read_intrinsics(f"a{suffix}", content)
    assert len(raised.value.problems) == 1


def test_a_header_that_is_no_literal_is_refused() -> None:
    content = b"\x93NUMPY\x01\x00\x76\x00" + b"{'descr': '<f8', 'fortran_order': False, 'shape': (3, (".ljust(118)
    assert attempt("a.npy", content) is None


def test_no_pickle_is_loaded_from_npy_or_npz() -> None:
    stream = io.BytesIO()
    np.save(stream, np.array([{"a": 1}], object), allow_pickle=True)
    assert attempt("a.npy", stream.getvalue()) is None
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("poses.npy", stream.getvalue())
    assert attempt("a.npz", packed.getvalue()) is None


def test_an_archive_that_unpacks_to_more_than_the_limit_is_not_unpacked() -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("poses.npy", npy(np.zeros((MAX_ARRAY_BYTES // 128 + 10, 4, 4))))
    assert len(packed.getvalue()) < 1_000_000
    assert attempt("a.npz", packed.getvalue()) is None


def test_entities_in_xml_are_not_expanded() -> None:
    bomb = b'<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;">]><a><camera_matrix>&c;</camera_matrix></a>'
    with pytest.raises(DocumentError, match="declarations"):
        read_intrinsics("a.xml", bomb)
