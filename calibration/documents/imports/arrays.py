"""Poses in numpy's files: NPY, and NPZ with one array of poses or with rotations and translations.

Pickled objects are never read; the sizes that a file states are checked before anything is unpacked.
"""

import io
import lzma
import zipfile
import zlib
from tokenize import TokenError

import numpy as np

from calibration.documents.imports.leaves import table_of_array, table_of_data
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import refusal
from calibration.errors import DocumentError
from calibration.transforms import Array

MAX_ARRAY_BYTES = 64_000_000
"""Bytes of an array with poses."""

DAMAGED = (
    ValueError, EOFError, OSError, OverflowError, SyntaxError, LookupError, TypeError, AttributeError, MemoryError,
    RecursionError, TokenError,
)  # fmt: skip
"""What numpy raises for a damaged file; its header is a Python literal."""
DAMAGED_ARCHIVE = (*DAMAGED, zipfile.BadZipFile, zlib.error, lzma.LZMAError, RuntimeError)
"""What zipfile and numpy raise for a damaged .npz file."""

FIX = "save an array n x 4 x 4, n x 7 or n x 6 of floats"


def read_npy(content: bytes, origin: str) -> PoseTable:
    """The poses of a .npy file. Raises DocumentError."""
    return table_of_array(load_npy(content, origin), origin)


def load_npy(content: bytes, origin: str) -> Array:
    """A numeric array of at most MAX_ARRAY_BYTES. Raises DocumentError."""
    try:
        stream = io.BytesIO(content)
        version = np.lib.format.read_magic(stream)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = header(stream)
        size = int(np.prod([float(side) for side in shape])) * kind.itemsize if not kind.hasobject else 0
        if kind.hasobject or kind.names or kind.kind not in "iuf":
            raise refusal(origin, "array", f"its elements are no numbers ({kind})", FIX)
        if size > MAX_ARRAY_BYTES or len(content) > MAX_ARRAY_BYTES:
            raise refusal(origin, "array", "larger than 64 MB", FIX)
        array = np.load(io.BytesIO(content), allow_pickle=False)
    except DAMAGED as error:
        raise refusal(origin, "file", f"no array of numpy ({str(error)[:80]})", FIX) from None
    return np.asarray(array, float)


def read_mat(content: bytes, origin: str) -> PoseTable:
    """The poses of MATLAB's .mat file (version 5), whose views are the last axis. Raises DocumentError."""
    import scipy.io  # an eighth of a second, and few bring such files

    if len(content) > MAX_ARRAY_BYTES:
        raise refusal(origin, "file", "larger than 64 MB", FIX)
    try:
        found = scipy.io.loadmat(io.BytesIO(content), struct_as_record=True)
    except (*DAMAGED_ARCHIVE, NotImplementedError, scipy.io.matlab.MatReadError) as error:
        raise refusal(origin, "file", f"no .mat file of version 5 ({str(error)[:80]})", "save it with -v6") from None
    arrays = {name: one for name, one in found.items() if isinstance(one, np.ndarray) and one.dtype.kind in "iuf"}
    if sum(one.nbytes for one in arrays.values()) > MAX_ARRAY_BYTES:
        raise refusal(origin, "file", "unpacks to more than 64 MB", FIX)
    moved = {name: np.moveaxis(one, 2, 0) if one.ndim == 3 else one for name, one in arrays.items()}
    return table_of_data({name: np.asarray(one, float) for name, one in moved.items()}, origin)


def read_npz(content: bytes, origin: str) -> PoseTable:
    """The poses of a .npz file. Raises DocumentError."""
    arrays = unpack_npz(content, origin)
    try:
        return table_of_data(dict(arrays), origin)
    except DocumentError as error:
        have = ", ".join(f"{name} {array.shape}" for name, array in list(arrays.items())[:8])
        what = f"not one array of poses among {have or 'none'} ({error.problems[0].what})"
        raise refusal(origin, "arrays", what, FIX) from None


def unpack_npz(content: bytes, origin: str) -> dict[str, Array]:
    """The numeric arrays of a .npz file, at most MAX_ARRAY_BYTES together. Raises DocumentError."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            if sum(member.file_size for member in members) > MAX_ARRAY_BYTES or len(members) > 100:
                raise refusal(origin, "file", "unpacks to more than 64 MB or 100 arrays", FIX)
            packed = {member.filename.removesuffix(".npy"): archive.read(member) for member in members}
    except DAMAGED_ARCHIVE as error:
        raise refusal(origin, "file", f"no .npz file ({str(error)[:80]})", FIX) from None
    return {name: load_npy(array, f"{origin}: {name}") for name, array in packed.items()}
