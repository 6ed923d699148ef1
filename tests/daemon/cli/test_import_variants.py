"""`handeyed import` of a plant's files in every spelling: imported right, or one error that says what to do."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import inverse
from tests.daemon.cli.plant_files import VARIANTS, Variant
from tests.daemon.cli.plant_notations import BACKWARDS, EYE_IN_HAND, POSES, TARGET, Q, csv, lines, quaternions
from tests.daemon.cli.running import Ran, handeyed

ROUNDED = {"quaternions of three decimals": 2e-3}
"""Largest difference of a rotation's elements where the file rounds them."""

ROUNDED_MM = {"inverted": 3e-3}
"""Largest difference of a place whose lever, 1.4 m, turns with a quaternion of six decimals."""


def _import(variant: Variant, folder: Path) -> Ran:
    written = variant.write(folder / "cell")
    return handeyed("import", written, "--out", folder / "s", "--target", TARGET, *variant.options)


@pytest.mark.parametrize("name", [name for name, variant in VARIANTS.items() if not variant.refused])
def test_it_is_imported_right(name: str, tmp_path: Path) -> None:
    variant = VARIANTS[name]
    ran = _import(variant, tmp_path)
    assert ran.status == 0, ran.err
    assert [words for words in variant.said if words not in ran.out] == []
    views = json.loads((tmp_path / "s" / "session.json").read_text())["views"]
    shown = [Path(picture).name for picture in variant.pictures]
    assert sorted(view["image"] for view in views) == sorted(shown)
    for view in views:
        pose = PoseDocument.model_validate(view["base_T_flange"]).transform()
        truth = POSES[shown.index(view["image"])]
        np.testing.assert_allclose(pose[:3, 3], truth[:3, 3] * variant.scale, atol=ROUNDED_MM.get(name, 1e-3))
        np.testing.assert_allclose(pose[:3, :3], truth[:3, :3], atol=ROUNDED.get(name, 1e-5))


@pytest.mark.parametrize("name", [name for name, variant in VARIANTS.items() if variant.refused])
def test_it_is_refused_with_one_error_that_says_what_to_do(name: str, tmp_path: Path) -> None:
    ran = _import(VARIANTS[name], tmp_path)
    assert ran.status == 2, ran.out
    (error,) = ran.errors
    assert [words for words in VARIANTS[name].refused if words not in error] == []
    assert "docs/formats.md#" in error
    assert not (tmp_path / "s").exists()


def test_what_is_stated_is_imported_but_said_not_to_fit(tmp_path: Path) -> None:
    rows = csv(lines(BACKWARDS, ("x_mm", "y_mm", "z_mm", *Q[3:])))
    ran = _import(Variant(rows, options=(*EYE_IN_HAND, "--frame", "base_T_flange")), tmp_path)
    assert ran.status == 0
    assert "was stated and does not fit: robot and images agree to" in ran.out
    assert "the poses are in reversed order" in ran.out


def test_the_option_that_makes_stated_poses_not_fit_is_noted(tmp_path: Path) -> None:
    rows = csv(lines(quaternions(inverse(POSES)), ("x_mm", "y_mm", "z_mm", *Q[3:])))
    ran = _import(Variant(rows, options=(*EYE_IN_HAND, "--frame", "base_T_flange")), tmp_path)
    assert ran.status == 0
    assert "note         without --frame they agree to" in ran.out
    assert "(quaternion-wxyz, mm, flange_T_base, eye-in-hand): leave --frame out" in ran.out


def test_poses_relative_to_the_first_are_pointed_out(tmp_path: Path) -> None:
    ran = _import(Variant(csv(lines(quaternions(inverse(POSES[0]) @ POSES), Q))), tmp_path)
    assert ran.status == 0
    assert "pose 1 is the identity: are the poses relative to it" in ran.out


def test_one_wrong_pose_is_pointed_out(tmp_path: Path) -> None:
    rows = quaternions()
    rows[2][1] += 30.0
    ran = _import(Variant(csv(lines(rows, Q))), tmp_path)
    assert ran.status == 0
    assert "robots err by less: look for a wrong pose" in ran.out
