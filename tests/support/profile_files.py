"""Profiles as a recorder writes them."""

from pathlib import Path

import numpy as np

from registration.profiles.profile_block import ProfileBlock


def write_npz(file: Path, block: ProfileBlock) -> None:
    """Write profiles as .npz, times in s."""
    np.savez_compressed(file, time=block.times_s, x_mm=block.x_mm, z_mm=block.z_mm)
