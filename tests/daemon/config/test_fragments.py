"""conf.d beside the settings file: later files win, each value's file is known, and the hash covers all of them."""

from pathlib import Path

import pytest

from calibration.errors import DocumentError
from daemon.config.settings import load_settings, load_settings_file, read_settings
from tests.daemon.cli.running import handeyed

MAIN = """
[robot]
address = "tcp://r:1"
box_mm = [[0, 0, 0], [1, 1, 1]]
[camera]
address = "http://c/"
[target]
kind = "chessboard"
columns = 11
rows = 8
pitch_mm = 20.0
[calibration]
tolerance_mm = 1.0
"""
CHARUCO = """
[target]
kind = "charuco"
columns = 8
rows = 5
square_mm = 30.0
marker_mm = 22.0
dictionary = "DICT_4X4_50"
"""


def cell(folder: Path, **fragments: str) -> Path:
    """The settings file of a cell, with fragments by name."""
    (folder / "conf.d").mkdir()
    for name, text in fragments.items():
        (folder / "conf.d" / f"{name}.toml").write_text(text)
    (folder / "handeyed.toml").write_text(MAIN)
    return folder / "handeyed.toml"


def test_fragments_are_read_in_the_order_of_their_names_and_the_later_wins(tmp_path: Path) -> None:
    file = cell(
        tmp_path,
        b_cell="[robot]\nspeed_mm_s = 50.0\nbox_mm = [[0, 0, 0], [2, 2, 2]]\n",
        a_plant="[robot]\nspeed_mm_s = 100.0\n[calibration]\ncount = 8\n",
    )
    settings = load_settings(file)
    assert (settings.robot.address, settings.robot.speed_mm_s) == ("tcp://r:1", 50.0)
    assert settings.robot.box_mm == ((0, 0, 0), (2, 2, 2))
    assert (settings.calibration.count, settings.calibration.tolerance_mm) == (8, 1.0)


def test_a_target_of_another_kind_replaces_the_whole_table_and_one_of_the_same_changes_keys(tmp_path: Path) -> None:
    file = cell(tmp_path, a=CHARUCO, b="[target]\nsquare_mm = 31.0\n")
    target = read_settings(file)[0]["target"]
    assert (target["kind"], target["square_mm"], "pitch_mm" in target) == ("charuco", 31.0, False)
    assert load_settings(file).target.kind == "charuco"


def test_lists_are_replaced_and_what_is_no_fragment_is_not_read(tmp_path: Path) -> None:
    hook = '[[webhooks]]\nreceiver = "{}"\nurl = "http://h/"\nsecret_file = "s"\n'
    file = cell(tmp_path, a=hook.format("one"), b=hook.format("two"))
    for name in (".hidden.toml", "c.toml~", "c.toml.bak", "README"):
        (tmp_path / "conf.d" / name).write_text("not TOML [")
    assert [hook.receiver for hook in load_settings(file).webhooks] == ["two"]


def test_each_value_has_the_file_that_gives_it(tmp_path: Path) -> None:
    file = cell(tmp_path, a=CHARUCO, b="[target]\nsquare_mm = 31.0\n[robot]\nspeed_mm_s = 50.0\n")
    given_by = {name: Path(by).name for name, by in load_settings_file(file)[1].given_by.items()}
    of_main = {"robot.address", "robot.box_mm", "camera.address", "calibration.tolerance_mm"}
    of_a = {f"target.{key}" for key in ("kind", "columns", "rows", "marker_mm", "dictionary")}
    assert {name for name, by in given_by.items() if by == "handeyed.toml"} == of_main
    assert {name for name, by in given_by.items() if by == "a.toml"} == of_a
    assert {name for name, by in given_by.items() if by == "b.toml"} == {"target.square_mm", "robot.speed_mm_s"}


def test_check_names_the_file_of_each_value_where_there_is_more_than_one(tmp_path: Path) -> None:
    ran = handeyed("check", "--config-only", str(cell(tmp_path, a="[robot]\nspeed_mm_s = 50.0\n")))
    first, main, fragment = ran.out.splitlines()
    assert "is complete and consistent" in first
    assert main.endswith(f"{tmp_path / 'handeyed.toml'} gives robot.address, robot.box_mm, camera.address, target.kind,"
                         " target.columns, target.rows, target.pitch_mm, calibration.tolerance_mm")  # fmt: skip
    assert fragment.endswith("a.toml gives robot.speed_mm_s")
    (tmp_path / "conf.d" / "a.toml").unlink()
    assert len(handeyed("check", "--config-only", str(tmp_path / "handeyed.toml")).out.splitlines()) == 1


@pytest.mark.parametrize(
    ("fragment", "says"),
    [
        ("[robot]\nspeed_mms = 50.0\n", "robot.speed_mms: unknown key (in {a}): did you mean 'speed_mm_s'?"),
        ("[robot]\nspeed_mm_s = 300\n", "robot.speed_mm_s: 300 is above 250 (in {a}): give 250 or less"),
        ("[robot]\nbox_mm = [[0, 0, 0], [1, nan, 1]]\n", "(in {a})"),
        ("[robot.egm]\nwindow_s = 9\n", "robot.egm.window_s: 9 is above 5 (in {a})"),
        ("[camra]\naddress = 'x'\n", "camra: unknown key (in {a}): did you mean 'camera'?"),
        ("[target]\npitchmm = 3\n", "target.chessboard.pitchmm: unknown key (in {a})"),
        ("[target]\npitch_mm = -3\n", "target.chessboard.pitch_mm: -3 is not above 0 (in {a})"),
    ],
)
def test_what_is_wrong_names_the_fragment(tmp_path: Path, fragment: str, says: str) -> None:
    file = cell(tmp_path, a=fragment, z="[calibration]\ncount = 8\n")
    with pytest.raises(DocumentError) as caught:
        load_settings(file)
    assert says.format(a=tmp_path / "conf.d" / "a.toml") in str(caught.value)
    assert str(caught.value).startswith(f"{file}: ")


@pytest.mark.parametrize("content", [b"[robot", b"\xff"])
def test_a_fragment_that_is_no_toml_is_named(tmp_path: Path, content: bytes) -> None:
    file = cell(tmp_path)
    (tmp_path / "conf.d" / "a.toml").write_bytes(content)
    with pytest.raises(DocumentError) as caught:
        load_settings(file)
    assert caught.value.origin == str(tmp_path / "conf.d" / "a.toml")


def test_a_folder_in_the_place_of_a_fragment_is_named_and_a_file_for_the_folder_is_none(tmp_path: Path) -> None:
    file = cell(tmp_path)
    (tmp_path / "conf.d" / "a.toml").mkdir()
    with pytest.raises(DocumentError, match=r"a\.toml"):
        load_settings(file)
    (tmp_path / "conf.d" / "a.toml").rmdir()
    (tmp_path / "conf.d").rmdir()
    (tmp_path / "conf.d").write_text("")
    assert load_settings(file).robot.address == "tcp://r:1"


def test_the_hash_covers_the_fragments_by_name_and_content(tmp_path: Path) -> None:
    file = cell(tmp_path)
    hashes = [load_settings_file(file)[1].sha256]
    fragment = tmp_path / "conf.d" / "a.toml"
    for text in ("", "[robot]\nspeed_mm_s = 50.0\n"):
        fragment.write_text(text)
        hashes.append(load_settings_file(file)[1].sha256)
    hashes.append(load_settings_file(fragment.rename(fragment.with_name("b.toml")) and file)[1].sha256)
    assert len(set(hashes)) == 4


def test_the_fragments_of_a_linked_file_lie_beside_what_the_link_names(tmp_path: Path) -> None:
    """As do its other relative files; a reload asks for the file by that name."""
    (tmp_path / "etc").mkdir()
    file = cell(tmp_path, a="[robot]\nspeed_mm_s = 50.0\n")
    link = tmp_path / "etc" / "handeyed.toml"
    link.symlink_to(file)
    settings, loaded = load_settings_file(link)
    assert settings.robot.speed_mm_s == 50.0
    assert load_settings_file(Path(loaded.file))[1].sha256 == loaded.sha256
