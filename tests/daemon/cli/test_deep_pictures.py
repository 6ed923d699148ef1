"""Sessions whose pictures hold 10 to 16 bits in 16-bit files."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import with_images

Deepen = Callable[[Any], Any]


def of_bits(bits: int) -> Deepen:
    """Grey levels 0 to 255 as 0 to 2^bits - 1."""
    return lambda grey: np.round(grey * ((2**bits - 1) / 255)).astype(np.uint16)


def dark(grey: Any) -> Any:
    """12 bits, of which the board uses the lowest 100 levels; a lamp in a corner uses all."""
    levels = np.round(grey * (100 / 255)).astype(np.uint16)
    levels[:40, :80] = 4095
    return levels


def with_hot_pixels(grey: Any) -> Any:
    """12 bits, and three pixels at the file's upper end."""
    levels = of_bits(12)(grey)
    levels[[10, 20, 470], [10, 600, 300]] = 65535
    return levels


def deepened(folder: Path, deepen: Deepen) -> Path:
    session = with_images(folder)
    for file in session.glob("*.png"):
        cv2.imwrite(str(file), deepen(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)))
    return session


@pytest.mark.parametrize(
    "deepen",
    [
        pytest.param(of_bits(10), id="10 bits"),
        pytest.param(of_bits(12), id="12 bits", marks=pytest.mark.slow),
        pytest.param(of_bits(14), id="14 bits", marks=pytest.mark.slow),
        pytest.param(of_bits(16), id="16 bits"),
        pytest.param(dark, id="dark"),
        pytest.param(with_hot_pixels, id="hot pixels"),
    ],
)
def test_every_picture_is_used(tmp_path: Path, deepen: Deepen) -> None:
    ran = handeyed("solve", deepened(tmp_path / "a", deepen), "--json")

    views = json.loads(ran.out)["views"]
    assert ran.status == 0
    assert [view["status"] for view in views] == ["used"] * 6


@pytest.mark.parametrize("suffix", [".tiff", ".png"])
def test_tiff_and_colour_are_read_as_well(tmp_path: Path, suffix: str) -> None:
    def change(document: dict[str, Any]) -> None:
        for view in document["views"]:
            grey = cv2.imread(str(tmp_path / "a" / view["image"]), cv2.IMREAD_GRAYSCALE)
            assert grey is not None
            view["image"] = f"{Path(view['image']).stem}_again{suffix}"
            deep = of_bits(12)(grey) if suffix == ".tiff" else np.dstack([of_bits(12)(grey)] * 3)
            cv2.imwrite(str(tmp_path / "a" / view["image"]), deep)

    assert handeyed("solve", with_images(tmp_path / "a", change)).status == 0


@pytest.mark.data
@pytest.mark.slow
def test_real_pictures_of_twelve_bits_are_all_found(real_data: Path) -> None:
    ran = handeyed("solve", real_data / "odd_sessions" / "png16", "--json", "--tolerance", "4")

    views = json.loads(ran.out)["views"]
    assert ran.status == 0
    assert [view["status"] for view in views] == ["used"] * 8
