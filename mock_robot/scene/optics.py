"""Effect of lens, light and sensor on an image: blur, shading, contrast, noise, saturation, quantisation."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]


@dataclass(frozen=True)
class Optics:
    """Optical and sensor parameters; grey levels are those of an 8-bit sensor.

    `blur_px` is the Gaussian's standard deviation (lens and defocus together). `vignetting` darkens the corners by
    that share, `uneven_light` tilts the illumination by that share from one side to the other. `read_noise` in grey
    levels; `electrons_per_level` sets the shot noise (0: none). `background` is the clutter's contrast, 0 to 1.
    """

    black: float = 30.0
    white: float = 200.0
    blur_px: float = 0.7
    vignetting: float = 0.15
    uneven_light: float = 0.1
    light_direction_rad: float = 0.6
    exposure: float = 1.0
    read_noise: float = 1.0
    electrons_per_level: float = 40.0
    background: float = 0.5


CLEAN = Optics(blur_px=0.0, vignetting=0.0, uneven_light=0.0, read_noise=0.0, electrons_per_level=0.0, background=0.0)
"""No blur, shading, noise or clutter: geometry only."""


def expose(reflectance: Picture, optics: Optics, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The 8-bit image (h, w) of a scene's reflectance (0 black to 1 white)."""
    levels = optical_levels(reflectance, optics)
    if optics.read_noise > 0 or optics.electrons_per_level > 0:
        variance = np.full_like(levels, optics.read_noise**2)
        if optics.electrons_per_level > 0:
            variance += np.maximum(levels, 0) * np.float32(1.0 / optics.electrons_per_level)
        noise = rng.standard_normal(levels.shape, dtype=np.float32)
        noise *= np.sqrt(variance)
        levels += noise
    levels += np.float32(0.5)
    return np.clip(levels, 0, 255, out=levels).astype(np.uint8)


def optical_levels(reflectance: Picture, optics: Optics) -> Picture:
    """Grey levels (h, w) before noise and quantisation."""
    levels = reflectance * np.float32(optics.white - optics.black) + np.float32(optics.black)
    levels *= _shading(levels.shape, optics)
    if optics.blur_px > 0:
        blurred = cv2.GaussianBlur(levels, (0, 0), optics.blur_px, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(blurred, np.float32)
    return levels


def _shading(shape: tuple[int, ...], optics: Optics) -> Picture:
    """Vignetting grows with the square of the distance from the centre; the light varies linearly to one side."""
    height, width = shape
    diagonal = np.hypot(width, height) / 2
    x = ((np.arange(width) - (width - 1) / 2) / diagonal).astype(np.float32)
    y = ((np.arange(height) - (height - 1) / 2) / diagonal).astype(np.float32)[:, None]
    tilt = 0.5 * optics.uneven_light
    along_x, along_y = tilt * np.cos(optics.light_direction_rad), tilt * np.sin(optics.light_direction_rad)
    row = 1 - optics.vignetting * x * x + along_x * x
    column = -optics.vignetting * y * y + along_y * y
    shading: Picture = (optics.exposure * (row + column)).astype(np.float32)
    return shading


def clutter(shape: tuple[int, int], contrast: float, rng: np.random.Generator) -> Picture:
    """Reflectance (h, w) of the surroundings of a target: mottled ground with boxes and streaks."""
    height, width = shape
    if contrast <= 0:
        return np.full(shape, 0.35, np.float32)
    coarse = rng.random((max(4, height // 90), max(4, width // 90)), dtype=np.float32)
    ground = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    for _ in range(int(rng.integers(8, 20))):
        corner = (int(rng.integers(0, width)), int(rng.integers(0, height)))
        size = (float(rng.uniform(0.02, 0.2) * width), float(rng.uniform(0.02, 0.2) * height))
        box = cv2.boxPoints((corner, size, float(rng.uniform(0, 180)))).astype(np.int32)
        cv2.fillPoly(ground, [box], float(rng.random()), lineType=cv2.LINE_8)
    return np.asarray(0.35 + contrast * (ground - 0.5) * 0.7, np.float32)
