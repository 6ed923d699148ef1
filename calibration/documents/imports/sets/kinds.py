"""The table of whole sets: how each is recognised and read; a folder that is none of them is read as any folder."""

from collections.abc import Callable
from dataclasses import dataclass

from calibration.documents.imports.sets import (
    bop,
    dataset_spec,
    folder,
    industrial_calibration,
    joint_states,
    metric,
    own,
    pose_pairs,
    tabb,
    visp,
    zivid,
)
from calibration.documents.imports.sets.imported import Files, ImportedSet


@dataclass(frozen=True)
class SetKind:
    """A kind of set; `read` takes the files and the part, such as a camera's folder."""

    name: str
    recognise: Callable[[Files], bool]
    read: Callable[[Files, str | None], ImportedSet]


KINDS = (
    SetKind("industrial_calibration", industrial_calibration.recognise, industrial_calibration.read),
    SetKind("dataset_spec", dataset_spec.recognise, dataset_spec.read),
    SetKind("METRIC", metric.recognise, metric.read),
    SetKind("BOP", bop.recognise, bop.read),
    SetKind("RWHE", tabb.recognise, tabb.read),
    SetKind("ViSP", visp.recognise, visp.read),
    SetKind("Zivid", zivid.recognise, zivid.read),
    SetKind("samples of pose pairs", pose_pairs.recognise, pose_pairs.read),
    SetKind("handeyed", own.recognise, own.read),
)


def read_set(files: Files, part: str | None, chosen: folder.Chosen, arm: str | None = None) -> ImportedSet:
    """The set in a folder; with globs given it is read as any folder. `arm`: of joint states. Raises DocumentError."""
    if chosen == folder.Chosen():
        for kind in KINDS:
            if kind.recognise(files):
                return kind.read(files, part)
        if (states := joint_states.find_joint_states(files)) is not None:
            return joint_states.read(files, states, arm)
    return folder.read(files, chosen)
