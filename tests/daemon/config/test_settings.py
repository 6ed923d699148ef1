"""The settings file: the example is complete, and every mistake is named with its place."""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from calibration.documents.target import TargetDocument
from calibration.errors import DocumentError
from daemon.config.settings import Settings, load_settings, parse_settings

EXAMPLE = Path(__file__).parents[3] / "deploy" / "handeyed.example.toml"
EVERYTHING = re.sub("^#(?! |$)", "", EXAMPLE.read_text(), flags=re.MULTILINE).replace(
    'source = "printed"', 'source = "measured"'
)
"""The example with all that it leaves out, of a target that was measured."""


OF_THE_OTHER_SETUP = {"base_T_camera_guess", "flange_T_target_guess"}

CHESSBOARD = """kind = "chessboard"
columns = 11
rows = 8
pitch_mm = 20.0"""

SMALLEST = f"""
[robot]
address = "tcp://r:1"
box_mm = [[0, 0, 0], [1, 1, 1]]
[camera]
address = "http://c/"
[target]
{CHESSBOARD}
"""


def models_in(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation)):
        yield annotation
    for inner in get_args(annotation):
        yield from models_in(inner)


def keys_of(model: type) -> set[str]:
    if issubclass(model, BaseModel):
        annotations = {name: field.annotation for name, field in model.model_fields.items()}
    else:
        annotations = {field.name: field.type for field in fields(model)}
    keys = set(annotations)
    for annotation in annotations.values():
        for inner in models_in(annotation):
            keys |= keys_of(inner)
    return keys


def keys_in(data: Any) -> set[str]:
    if isinstance(data, dict):
        return set(data) | {key for value in data.values() for key in keys_in(value)}
    if isinstance(data, list):
        return {key for value in data for key in keys_in(value)}
    return set()


def test_the_example_loads() -> None:
    settings = load_settings(EXAMPLE)
    assert (settings.calibration.count, settings.calibration.tolerance_mm) == (None, 1.0)
    assert settings.storage.folder == "/var/lib/handeyed"


def test_the_example_shows_every_key_of_the_model_and_no_other() -> None:
    shown = tomllib.loads(EVERYTHING)
    of_other_targets = set().union(*map(keys_of, models_in(TargetDocument))) - set(shown["target"])
    assert (
        keys_in(shown) - {*shown["cameras"], *shown["scanners"]}
        == keys_of(Settings) - of_other_targets - OF_THE_OTHER_SETUP
    )
    comments = "\n".join(line for line in EXAMPLE.read_text().splitlines() if line.startswith("# "))
    assert [key for key in sorted(of_other_targets) if key not in comments] == []
    assert [key for key in sorted(OF_THE_OTHER_SETUP) if key not in comments] == []


def test_the_example_with_all_that_it_leaves_out_is_understood() -> None:
    everything = parse_settings(EVERYTHING.encode(), "everything")
    assert all(value is not None for _, value in everything)


def test_the_example_differs_from_the_defaults_in_nothing_but_what_a_cell_must_say() -> None:
    """A key that has a default is shown with it, so that deleting a line changes nothing."""
    example = load_settings(EXAMPLE)
    smallest = parse_settings(SMALLEST.encode(), "smallest")
    differ = {name for name, value in example if value != getattr(smallest, name)}
    assert differ == {"robot", "camera", "target", "calibration"}
    stated = example.calibration.model_copy(update={"tolerance_mm": None})
    assert stated == smallest.calibration and example.calibration.tolerance_mm is not None
    given = {"address", "box_mm", "model"}
    assert example.robot.model_dump(exclude=given) == smallest.robot.model_dump(exclude=given)
    assert example.camera.model_dump(exclude=given) == smallest.camera.model_dump(exclude=given)


@pytest.mark.parametrize(
    ("setup", "name"),
    [("eye-in-hand", "base_T_camera_guess"), ("eye-in-hand", "flange_T_target_guess"),
     ("eye-to-hand", "flange_T_camera_guess"), ("eye-to-hand", "base_T_target_guess")],
)  # fmt: skip
def test_a_guess_of_the_other_set_up_is_refused(setup: str, name: str) -> None:
    pose = "{ translation_mm = [0.0, 0.0, 1.0], quaternion_wxyz = [1.0, 0.0, 0.0, 0.0] }"
    text = SMALLEST.replace("[camera]", f'[camera]\nsetup = "{setup}"') + f"[calibration]\n{name} = {pose}\n"
    with pytest.raises(DocumentError, match=f"{name} belongs to"):
        parse_settings(text.encode(), "settings")


@pytest.mark.parametrize("model", ["", 'model = "IRB 14050-0.5/0.5"'])
def test_the_errors_of_an_arm_that_is_not_known_by_six_axes_are_not_asked_for(model: str) -> None:
    text = SMALLEST.replace("[robot]", f"[robot]\n{model}") + "[calibration]\narm = true\n"
    with pytest.raises(DocumentError, match="six axes"):
        parse_settings(text.encode(), "settings")


HANGS, LEANS = (f"base_frame = {{ translation_mm = [0, 0, 2500], quaternion_wxyz = {one} }}" for one in (
    [0, 1, 0, 0], [0.999, 0.0447, 0, 0],
))  # fmt: skip


def test_the_errors_of_an_arm_that_hangs_are_not_asked_for() -> None:
    """Weight would lower it towards the base's +z, where the errors of an arm have -z."""
    settings = SMALLEST + "[calibration]\narm = true\n"
    leaning, hanging = (
        settings.replace("[robot]", f'[robot]\nmodel = "IRB 1600-6/1.45"\n{frame}').encode() for frame in (LEANS, HANGS)
    )
    assert parse_settings(leaning, "settings").calibration.arm
    with pytest.raises(DocumentError, match="base_frame upright: else leave arm out"):
        parse_settings(hanging, "settings")


def test_the_mark_of_windows_editors_is_no_part_of_the_text() -> None:
    assert parse_settings(b"\xef\xbb\xbf" + SMALLEST.encode(), "settings").robot.address == "tcp://r:1"


@pytest.mark.parametrize(
    ("change", "place", "says"),
    [
        (("pitch_mm", "pitchmm"), "target.chessboard.pitchmm", "did you mean 'pitch_mm'?"),
        (("[camera]", "[camra]"), "camra", "did you mean 'camera'?"),
        (("[camera]", "[camera]\nmatrix = 1"), "camera.matrix", "unknown key: move it to camera.intrinsics"),
        (("[camera]", "[camera]\nwindow_s = 1"), "camera.window_s", "robot.egm"),
        (("[camera]", "[camera]\nserver = 1"), "camera.server", "move it to the top level, or remove it"),
        (("pitch_mm", "square_mm"), "target.chessboard.square_mm", "move it to target.charuco, or remove it"),
        (
            (
                CHESSBOARD,
                'kind = "charuco"\ncolumns = 5\nrows = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = "DICT_NONE"',
            ),
            "target.charuco",
            "the dictionary 'DICT_NONE' is not known",
        ),
        (
            (CHESSBOARD, 'kind = "apriltag-grid"\ncolumns = 5\nrows = 7\ntag_mm = 24\ngap_mm = 8\nfamily = "tag99h9"'),
            "target.apriltag-grid",
            "use one of tag36h11",
        ),
        (('address = "tcp://r:1"', "speed_mm_s = 300"), "robot.speed_mm_s", "300 is above 250"),
        (('kind = "chessboard"\n', ""), "target", "is without 'kind'"),
        (('address = "tcp://r:1"', ""), "robot.address", "missing"),
        (("[1, 1, 1]", "[1, -1, 1]"), "robot", "each minimum below its maximum"),
        (("[1, 1, 1]", "[1, nan, 1]"), "robot.box_mm[1][1]", "finite"),
        (('address = "tcp://r:1"', 'address = "tcp://r:1"\nmodel = "IRB 1600-6"'), "robot.model", "IRB 1600-6/1.45"),
        (("[camera]", '[server]\nhost = "0.0.0.0"\n[camera]'), "server", "handeyed tls init"),
        (("[camera]", '[storage]\nfolder = "~/store"\n[camera]'), "storage.folder", "give the whole path"),
        (("[camera]", "[calibration]\ncount = 2\n[camera]"), "calibration.count", "2 is below 3: give 3 or more"),
        (
            (
                "[camera]",
                "[calibration]\nposes = [{translation_mm = [1, 2, 3], quaternion_wxyz = [0.9, 0, 0, 0]}]\n[camera]",
            ),
            "calibration.poses[0].quaternion_wxyz",
            "norm 0.9",
        ),
    ],
)
def test_a_mistake_is_reported_with_file_place_and_what_to_do(change: tuple[str, str], place: str, says: str) -> None:
    text = SMALLEST.replace(*change)
    assert text != SMALLEST
    with pytest.raises(DocumentError) as caught:
        parse_settings(text.encode(), "cell.toml")
    problem = next(problem for problem in caught.value.problems if problem.place == place)
    assert says in str(problem)
    assert str(caught.value).startswith("cell.toml: ")


def test_an_address_may_stand_in_brackets_as_in_a_url() -> None:
    text = SMALLEST.replace("[camera]", '[server]\nhost = "[::1]"\n[plc]\nhost = "[::1]"\n[camera]')
    settings = parse_settings(text.encode(), "cell.toml")
    assert settings.plc is not None
    assert (settings.server.host, settings.server.local_url) == ("::1", "http://[::1]:8372")
    assert settings.plc.host == "::1"


def test_a_missing_file_torn_toml_and_other_bytes_are_reported(tmp_path: Path) -> None:
    for name, content, says in (
        ("none.toml", None, "No such file or directory: give its path; 'handeyed init' writes one"),
        ("torn.toml", b'[robot\naddress = "x"', "line 1"),
        ("bytes.toml", b"\xff\xfe", "UTF-8"),
    ):
        file = tmp_path / name
        if content is not None:
            file.write_bytes(content)
        with pytest.raises(DocumentError, match=says) as caught:
            load_settings(file)
        assert caught.value.origin == str(file)
        assert caught.value.problems[0].fix


def test_a_file_without_end_is_reported() -> None:
    with pytest.raises(DocumentError, match="Not a regular file"):
        load_settings(Path("/dev/zero"))


def test_a_relative_folder_is_taken_from_the_files_own(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(SMALLEST + '[storage]\nfolder = "state"\n')
    assert load_settings(file).storage.folder == str(tmp_path / "state")
